// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/spectral/eigenbasis.h"

#include <Spectra/SymEigsSolver.h>

#include <Eigen/Eigenvalues>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <string>

#include "supple/core/dense.h"
#include "supple/core/error.h"
#include "supple/geometry/sparse_cholesky.h"

namespace supple {
namespace {

// Eigenvalues closer than this, relative to their size, count as one.
constexpr double kMultiple = 1e-4;

// (M^-1/2 W M^-1/2 + shift)^-1 minus what is already found: the operator whose largest eigenvalues
// are the wanted ones. Its only input from Spectra is a vector.
class ShiftInvert {
 public:
  using Scalar = double;
  ShiftInvert(const SparseCholesky& factor, const Eigen::VectorXd& root_mass,
              const Eigen::MatrixXd& found, const ProgressRange& progress, int expected)
      : factor_(factor),
        root_mass_(root_mass),
        found_(found),
        progress_(progress),
        expected_(expected) {}

  Eigen::Index rows() const { return root_mass_.size(); }
  Eigen::Index cols() const { return root_mass_.size(); }
  void perform_op(const double* in, double* out) const {
    progress_.report(std::min(0.95, double(++applied_) / expected_));
    Eigen::VectorXd x = Eigen::Map<const Eigen::VectorXd>(in, rows());
    deflate(x);
    Eigen::VectorXd y = root_mass_.cwiseProduct(factor_.solve(root_mass_.cwiseProduct(x)).col(0));
    deflate(y);
    Eigen::Map<Eigen::VectorXd>(out, rows()) = y;
  }

 private:
  void deflate(Eigen::VectorXd& x) const {
    if (found_.cols() > 0) {
      x -= found_ * (found_.transpose() * x);
    }
  }
  const SparseCholesky& factor_;
  const Eigen::VectorXd& root_mass_;
  const Eigen::MatrixXd& found_;
  const ProgressRange& progress_;
  int expected_;
  mutable int applied_ = 0;
};

SparseMatrix shifted(const SparseMatrix& laplacian, const Eigen::VectorXd& mass, double shift) {
  SparseMatrix result = laplacian;
  result.diagonal() += shift * mass;
  return result;
}

// Number of eigenvalues below `value`, by the signs of D in W - value M = L D L^T; -1 if that
// fails.
Eigen::Index count_below(const SparseMatrix& laplacian, const Eigen::VectorXd& mass, double value) {
  const Eigen::SimplicialLDLT<SparseMatrix> factor(shifted(laplacian, mass, -value));
  if (factor.info() != Eigen::Success) {
    return -1;
  }
  return (factor.vectorD().array() < 0.0).count();
}

struct Pairs {
  Eigen::VectorXd values;   // ascending
  Eigen::MatrixXd vectors;  // of M^-1/2 W M^-1/2, orthonormal
};

// Rayleigh-Ritz in the span of `vectors` (made orthonormal), ascending.
Pairs rayleigh_ritz(const SparseMatrix& symmetric, const Eigen::MatrixXd& vectors) {
  if (vectors.cols() == 0) {
    return {Eigen::VectorXd(0), vectors};
  }
  const Eigen::MatrixXd q = Eigen::HouseholderQR<Eigen::MatrixXd>(vectors).householderQ() *
                            Eigen::MatrixXd::Identity(vectors.rows(), vectors.cols());
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> small(q.transpose() * (symmetric * q));
  return {small.eigenvalues(), q * small.eigenvectors()};
}

Pairs dense_pairs(const SparseMatrix& symmetric, Eigen::Index count) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver{Eigen::MatrixXd(symmetric)};
  return {solver.eigenvalues().head(count), solver.eigenvectors().leftCols(count)};
}

Eigen::MatrixXd lanczos(const SparseCholesky& factor, const Eigen::VectorXd& root_mass,
                        const Eigen::MatrixXd& found, Eigen::Index count,
                        const EigenbasisOptions& options, const ProgressRange& progress) {
  const Eigen::Index n = root_mass.size();
  const Eigen::Index krylov = std::min(n - found.cols(), std::max<Eigen::Index>(2 * count, 20));
  ShiftInvert op(factor, root_mass, found, progress, static_cast<int>(2 * krylov));
  Spectra::SymEigsSolver<ShiftInvert> solver(op, count, krylov);
  solver.init();  // a fixed pseudo-random start: the same bytes every time
  solver.compute(Spectra::SortRule::LargestAlge, options.max_iterations, 1e-13,
                 Spectra::SortRule::LargestAlge);
  // Not asking for Success: 1e-13 is a wish; what counts is the residual checked by the caller.
  const Eigen::MatrixXd found_now = solver.eigenvectors(count);  // the converged ones only
  return found_now.cols() > 0 ? found_now : Eigen::MatrixXd(n, 0);
}

// How many pairs are still to be found: up to `count`, and below the last of those found.
Eigen::Index count_missing(const SparseMatrix& laplacian, const Eigen::VectorXd& mass,
                           const Pairs& pairs, Eigen::Index count) {
  if (pairs.values.size() < count) {
    return count - pairs.values.size();
  }
  const double top = pairs.values[count - 1] * (1.0 - kMultiple);
  const Eigen::Index found = (pairs.values.array() < top).count();
  return std::max<Eigen::Index>(count_below(laplacian, mass, top) - found, 0);
}

double worst_residual(const SparseMatrix& symmetric, const Pairs& pairs) {
  const Eigen::MatrixXd r = symmetric * pairs.vectors - pairs.vectors * pairs.values.asDiagonal();
  double worst = 0.0;
  for (Eigen::Index i = 0; i < r.cols(); ++i) {
    worst = std::max(worst, r.col(i).norm() / std::max(pairs.values[i], 1.0));
  }
  return worst;
}

// What rounding alone leaves of a residual: slivers make the matrix's norm, and this, large.
double rounding_floor(const SparseMatrix& symmetric) {
  double largest_column = 0.0;
  for (int c = 0; c < symmetric.outerSize(); ++c) {
    double sum = 0.0;
    for (SparseMatrix::InnerIterator it(symmetric, c); it; ++it) {
      sum += std::abs(it.value());
    }
    largest_column = std::max(largest_column, sum);
  }
  return 16.0 * std::numeric_limits<double>::epsilon() * largest_column;
}

}  // namespace

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
                      const EigenbasisOptions& options, ProgressRange progress) {
  const Eigen::Index n = mass.size();
  if (options.count < 1) {
    throw Error(ErrorCode::bad_option, "The number of eigenfunctions must be at least 1, not " +
                                           std::to_string(options.count) + ".");
  }
  const Eigen::Index count = std::min<Eigen::Index>(options.count, n);
  const Eigen::VectorXd root_mass = mass.cwiseSqrt();
  const Eigen::VectorXd inverse_root = root_mass.cwiseInverse();
  const SparseMatrix symmetric = inverse_root.asDiagonal() * laplacian * inverse_root.asDiagonal();

  Pairs pairs;
  if (n <= std::max<Eigen::Index>(3 * count, 64)) {
    pairs = dense_pairs(symmetric, count);
  } else {
    // Of the order of the second eigenvalue, so that the factor stays well conditioned.
    const double shift = 1.0 / mass.sum();
    const SparseCholesky factor(shifted(laplacian, mass, shift));
    pairs = rayleigh_ritz(
        symmetric, lanczos(factor, root_mass, Eigen::MatrixXd(n, 0), count, options, progress));
    // Lanczos can leave pairs out: those that did not converge, and copies of a multiple
    // eigenvalue. Look for them in the complement.
    for (int attempt = 0; attempt < 3; ++attempt) {
      const Eigen::Index missing = count_missing(laplacian, mass, pairs, count);
      if (missing == 0) {
        break;
      }
      const Eigen::Index wanted = std::min<Eigen::Index>(missing + 2, n - pairs.vectors.cols() - 1);
      const Eigen::MatrixXd more =
          lanczos(factor, root_mass, pairs.vectors, wanted, options, progress);
      Eigen::MatrixXd joined(n, pairs.vectors.cols() + more.cols());
      joined << pairs.vectors, more;
      pairs = rayleigh_ritz(symmetric, joined);
    }
    if (pairs.values.size() < count) {
      throw Error(ErrorCode::no_convergence, "Only " + std::to_string(pairs.values.size()) +
                                                 " of " + std::to_string(count) +
                                                 " eigenfunctions reached their residual. Remove "
                                                 "slivers from the mesh or ask for fewer "
                                                 "functions.");
    }
    pairs.values.conservativeResize(count);
    pairs.vectors.conservativeResize(n, count);
  }

  Eigenbasis basis;
  basis.mass = mass;
  basis.values = pairs.values.cwiseMax(0.0);
  basis.functions = inverse_root.asDiagonal() * pairs.vectors;
  basis.residual = worst_residual(symmetric, pairs);
  const double reachable = std::max(options.residual, rounding_floor(symmetric));
  if (!(basis.residual <= reachable)) {
    std::ostringstream message;
    message << "The eigenbasis reached a residual of " << basis.residual << ", not " << reachable
            << ". Remove slivers from the mesh or ask for fewer functions.";
    throw Error(ErrorCode::no_convergence, message.str());
  }
  progress.report(1.0);
  return basis;
}

}  // namespace supple
