// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/spectral/eigenbasis.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>
#include <utility>

#include "block_krylov.h"
#include "eigenproblem.h"
#include "lanczos.h"
#include "multiresolution.h"
#include "supple/core/dense.h"
#include "supple/core/error.h"

namespace supple {
namespace {

// Eigenvalues closer than this, relative to their size, count as one.
constexpr double kMultiple = 1e-4;
// Copies of an eigenvalue closer than this are told apart by rounding alone.
constexpr double kSame = 1e-7;
// From here, an exact basis takes gigabytes and a minute.
constexpr Eigen::Index kLarge = 250000;

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
  return n >= kLarge ? EigenMethod::multiresolution : EigenMethod::block_krylov;
}

Pairs dense_pairs(const SparseMatrix& symmetric, Eigen::Index count) {
  Eigen::MatrixXd vectors = symmetric;
  const Eigen::VectorXd values = symmetric_eigen(vectors);
  return {values.head(count), vectors.leftCols(count)};
}

// The pairs of both, ascending, the first `count` of them.
Pairs merged(const Pairs& a, const Pairs& b, Eigen::Index count) {
  Pairs result;
  count = std::min(count, a.size() + b.size());
  result.values.resize(count);
  result.vectors.resize(a.vectors.rows(), count);
  for (Eigen::Index i = 0, j = 0; i + j < count;) {
    const Eigen::Index to = i + j;
    if (j == b.size() || (i < a.size() && a.values[i] <= b.values[j])) {
      result.values[to] = a.values[i];
      result.vectors.col(to) = a.vectors.col(i++);
    } else {
      result.values[to] = b.values[j];
      result.vectors.col(to) = b.vectors.col(j++);
    }
  }
  return result;
}

// The most copies of one eigenvalue.
Eigen::Index most_copies(const Eigen::VectorXd& values) {
  Eigen::Index most = 0, first = 0;
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    if (values[i] - values[first] > kSame * std::max(values[i], 1.0)) {
      first = i;
    }
    most = std::max(most, i - first + 1);
  }
  return most;
}

// All pairs but the kernel's. A block method finds as many copies of an eigenvalue as a block has
// vectors, a single vector finds one by right and more by rounding: the rest is in the complement.
Pairs krylov_pairs(const Eigenproblem& problem, Eigen::Index count,
                   const EigenbasisOptions& options, EigenMethod method,
                   const ProgressRange& progress) {
  const bool single = method == EigenMethod::lanczos;
  const auto search = [&](const RowMatrix<double>& locked, Eigen::Index wanted, uint64_t seed) {
    return single ? lanczos(problem, locked, wanted, options.max_restarts, progress)
                  : block_krylov(problem, locked,
                                 {.count = wanted,
                                  .tolerance = 0.4 * options.residual,
                                  .max_restarts = options.max_restarts,
                                  .seed = seed},
                                 progress);
  };
  Pairs found = search(RowMatrix<double>(problem.size(), 0), count, 1);
  const Eigen::Index together = single ? 1 : block_width(count);
  for (uint64_t seed = 2; found.size() < count || most_copies(found.values) >= together; ++seed) {
    const Eigen::Index left = problem.size() - problem.kernel_size() - found.size();
    if (left < 4 || seed > 40) {
      break;
    }
    const Pairs more = search(found.vectors, std::min<Eigen::Index>(left / 4, 4), seed);
    if (more.size() == 0 ||
        (found.size() == count && more.values[0] >= found.values[count - 1] * (1.0 - kSame))) {
      break;
    }
    found = merged(found, more, count);
  }
  return found;
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
  const RowMatrix<double> head = functions.leftCols(count);
  return product(head, Op::transpose, weighted, Op::none);
}

RowMatrix<double> Eigenbasis::expand(const RowMatrix<double>& coefficients) const {
  const RowMatrix<double> head = functions.leftCols(coefficients.rows());
  return product(head, coefficients);
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
    } else if (basis.method == EigenMethod::multiresolution) {
      pairs =
          merged(constants, multiresolution(problem, rest, options.coarse_residual, work), count);
    } else {
      pairs = merged(constants, krylov_pairs(problem, rest, options, basis.method, work), count);
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
