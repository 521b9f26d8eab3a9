// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/spectral/eigenbasis.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>
#include <utility>

#include "block_krylov.h"
#include "copies.h"
#include "eigenproblem.h"
#include "lanczos.h"
#include "multiresolution.h"
#include "supple/core/dense.h"
#include "supple/core/error.h"
#include "supple/core/tall.h"

namespace supple {
namespace {

// Eigenvalues closer than this, relative to their size, count as one.
constexpr double kMultiple = 1e-4;
// Copies of an eigenvalue closer than this are told apart by rounding alone.
constexpr double kSame = 1e-7;

constexpr std::pair<EigenMethod, const char*> kMethods[] = {
    {EigenMethod::automatic, "automatic"},
    {EigenMethod::block_krylov, "block_krylov"},
    {EigenMethod::multiresolution, "multiresolution"},
    {EigenMethod::lanczos, "lanczos"},
    {EigenMethod::dense, "dense"},
};

// With few vertices, all eigenvalues are found sooner than some.
bool small_enough_for_dense(Eigen::Index n, Eigen::Index count) { return n <= 4 * count + 64; }

EigenMethod chosen(EigenMethod asked, Eigen::Index n, Eigen::Index count) {
  if (small_enough_for_dense(n, count)) {
    return EigenMethod::dense;
  }
  if (asked != EigenMethod::automatic) {
    return asked;
  }
  return EigenMethod::block_krylov;
}

Pairs dense_pairs(const SparseMatrix& symmetric, Eigen::Index count) {
  Eigen::MatrixXd vectors = symmetric;
  const Eigen::VectorXd values = symmetric_eigen(vectors);
  return {values.head(count), vectors.leftCols(count)};
}

// All pairs but the kernel's.
Pairs krylov_pairs(const Eigenproblem& problem, Eigen::Index count,
                   const EigenbasisOptions& options, EigenMethod method,
                   const ProgressRange& progress) {
  const bool single = method == EigenMethod::lanczos;
  return with_all_copies(problem, count, single ? 1 : block_width(count), kSame,
                         [&](const RowMatrix<double>& locked, Eigen::Index wanted, uint64_t seed) {
                           return single ? lanczos(problem, locked, wanted, options.max_restarts,
                                                   progress)
                                         : block_krylov(problem, locked,
                                                        {.count = wanted,
                                                         .tolerance = 0.4 * options.residual,
                                                         .max_restarts = options.max_restarts,
                                                         .seed = seed},
                                                        progress);
                         });
}

std::string advice() { return ". Remove slivers from the mesh or ask for fewer functions."; }

}  // namespace

const char* to_string(EigenMethod method) {
  for (const auto& [value, name] : kMethods) {
    if (value == method) {
      return name;
    }
  }
  return "";
}

EigenMethod eigen_method(const std::string& name) {
  for (const auto& [value, known] : kMethods) {
    if (name == known) {
      return value;
    }
  }
  throw Error(ErrorCode::bad_option,
              "'" + name +
                  "' is no way to find eigenfunctions. Use 'automatic', 'block_krylov', "
                  "'multiresolution', 'lanczos' or 'dense'.");
}

RowMatrix<double> Eigenbasis::coefficients(const RowMatrix<double>& field,
                                           Eigen::Index count) const {
  const RowMatrix<double> weighted = mass.asDiagonal() * field;
  return tall_product<double>({functions.leftCols(count)}, weighted);
}

RowMatrix<double> Eigenbasis::expand(const RowMatrix<double>& coefficients) const {
  RowMatrix<double> result = RowMatrix<double>::Zero(functions.rows(), coefficients.cols());
  add_tall_product<double>(1.0, {functions.leftCols(coefficients.rows())}, coefficients, result);
  return result;
}

RowMatrix<double> Eigenbasis::project(const RowMatrix<double>& field, Eigen::Index count) const {
  return expand(coefficients(field, count));
}

Eigen::Index Eigenbasis::stable_count(Eigen::Index limit) const {
  if (limit >= size()) {
    return size();
  }
  const auto gap_above = [&](Eigen::Index k) {
    return values[k] - values[k - 1] > kMultiple * std::max(values[k], 1.0);
  };
  for (Eigen::Index k = limit; k >= 1; --k) {
    if (gap_above(k)) {
      return k;
    }
  }
  for (Eigen::Index k = limit + 1; k < size(); ++k) {
    if (gap_above(k)) {
      return k;
    }
  }
  return size();
}

Eigen::Index stable_count(const Eigenbasis& a, const Eigenbasis& b, Eigen::Index limit) {
  for (int step = 0; step < 16; ++step) {  // the two can push each other up and down near the ends
    const Eigen::Index count = b.stable_count(a.stable_count(limit));
    if (count == limit || count == a.stable_count(count)) {
      return count;
    }
    limit = count;
  }
  return std::min({limit, a.size(), b.size()});
}

Eigenbasis eigenbasis(const SparseMatrix& laplacian, const Eigen::VectorXd& mass,
                      const EigenbasisOptions& options, ProgressRange progress,
                      std::shared_ptr<const SymbolicCholesky> symbolic) {
  if (options.count < 1) {
    throw Error(ErrorCode::bad_option, "The number of eigenfunctions must be at least 1, not " +
                                           std::to_string(options.count) + ".");
  }
  const Eigen::Index n = mass.size();
  const Eigen::Index count = std::min<Eigen::Index>(options.count, n);
  Eigenbasis basis;
  basis.method = chosen(options.method, n, count);
  basis.mass = mass;

  const Eigenproblem problem(laplacian, mass, std::move(symbolic));
  progress.report(0.05);
  Pairs pairs;
  if (basis.method == EigenMethod::dense) {
    pairs = dense_pairs(problem.symmetric(), count);
  } else {
    RowMatrix<double> kernel = problem.kernel(count);
    const Eigen::Index rest = count - kernel.cols();
    const Pairs constants{Eigen::VectorXd::Zero(kernel.cols()), std::move(kernel)};
    const ProgressRange work = progress.stage("eigenbasis", 0.05, 1.0);
    if (rest == 0) {
      pairs = constants;
    } else {
      Pairs others{Eigen::VectorXd(0), {}};
      if (basis.method == EigenMethod::multiresolution) {
        others = multiresolution(problem, rest, options.coarse_residual, work);
        if (others.size() == 0) {
          basis.method = EigenMethod::block_krylov;
        }
      }
      if (basis.method != EigenMethod::multiresolution) {
        others = krylov_pairs(problem, rest, options, basis.method, work);
      }
      pairs = merged(constants, others, count);
    }
  }
  if (pairs.size() < count) {
    throw Error(ErrorCode::no_convergence, "Only " + std::to_string(pairs.size()) + " of " +
                                               std::to_string(count) +
                                               " eigenfunctions reached their residual" + advice());
  }
  pairs.values = pairs.values.cwiseMax(0.0);
  basis.residual = problem.residuals(pairs).maxCoeff();
  const double wanted =
      basis.method == EigenMethod::multiresolution ? options.coarse_residual : options.residual;
  const double reachable = std::max(wanted, problem.rounding_floor());
  if (!(basis.residual <= reachable)) {
    std::ostringstream message;
    message << "The eigenbasis reached a residual of " << basis.residual << ", not " << reachable
            << advice();
    throw Error(ErrorCode::no_convergence, message.str());
  }
  basis.values = std::move(pairs.values);
  basis.functions = std::move(pairs.vectors);
  const Eigen::VectorXd inverse_root = problem.root_mass().cwiseInverse();
#pragma omp parallel for schedule(static)
  for (Eigen::Index i = 0; i < n; ++i) {
    basis.functions.row(i) *= inverse_root[i];
  }
  progress.report(1.0);
  return basis;
}

}  // namespace supple
