// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/sparse_cholesky.h"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "factor.h"
#include "ordering.h"
#include "supple/core/error.h"

namespace supple {
namespace {

using Permutation = Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int>;

// A = P^T L D L^T P with an ordering P that is given from outside.
class EigenFactor : public Factor {
 public:
  EigenFactor(const SparseMatrix& matrix, const Eigen::VectorXi& ordering) : place_(ordering) {
    SparseMatrix ordered(matrix.rows(), matrix.cols());
    ordered.selfadjointView<Eigen::Lower>() =
        matrix.selfadjointView<Eigen::Lower>().twistedBy(place_.inverse());
    factor_.compute(ordered);
    // LDL^T also factors indefinite matrices; a definite one has a positive D.
    if (factor_.info() != Eigen::Success || !(factor_.vectorD().array() > 0.0).all()) {
      throw_not_definite(matrix.rows());
    }
  }
  Eigen::Index entries() const override {
    return factor_.matrixL().nestedExpression().nonZeros() + factor_.vectorD().size();
  }
  RowMatrix<double> solve(const RowMatrix<double>& rhs, Substitution part,
                          Precision) const override {
    Eigen::MatrixXd x = rhs;
    const Eigen::VectorXd root = factor_.vectorD().cwiseSqrt();
    if (part != Substitution::backward) {
      x = place_.inverse() * x;
      factor_.matrixL().solveInPlace(x);
      x = root.cwiseInverse().asDiagonal() * x;
    }
    if (part != Substitution::forward) {
      x = root.cwiseInverse().asDiagonal() * x;
      factor_.matrixU().solveInPlace(x);
      x = place_ * x;
    }
    return x;
  }

 private:
  Permutation place_;
  Eigen::SimplicialLDLT<SparseMatrix, Eigen::Lower, Eigen::NaturalOrdering<int>> factor_;
};

Eigen::VectorXi amd_ordering(const SparseMatrix& pattern) {
  Permutation inverse;
  Eigen::AMDOrdering<int>()(pattern.selfadjointView<Eigen::Lower>(), inverse);
  return inverse.indices();
}

void check_square(const SparseMatrix& matrix) {
  if (matrix.rows() != matrix.cols()) {
    throw Error(ErrorCode::wrong_shape, "The system is " + std::to_string(matrix.rows()) + " x " +
                                            std::to_string(matrix.cols()) + "; it must be square.");
  }
}

void check_ordering(const Eigen::VectorXi& ordering, Eigen::Index n) {
  if (!is_ordering(ordering, n)) {
    throw Error(ErrorCode::bad_option, "The ordering given for a system of " + std::to_string(n) +
                                           " rows does not name each of them once.");
  }
}

}  // namespace

CholeskyBackend cholesky_backend(const std::string& name) {
  if (name == "cholmod") {
    return CholeskyBackend::cholmod;
  }
  if (name == "eigen") {
    return CholeskyBackend::eigen;
  }
  throw Error(ErrorCode::bad_option,
              "There is no Cholesky backend '" + name + "'. Use 'cholmod' or 'eigen'.");
}

CholeskyOrdering cholesky_ordering(const std::string& name) {
  if (name == "automatic") {
    return CholeskyOrdering::automatic;
  }
  if (name == "amd") {
    return CholeskyOrdering::amd;
  }
  if (name == "metis") {
    return CholeskyOrdering::metis;
  }
  throw Error(ErrorCode::bad_option,
              "There is no ordering '" + name + "'. Use 'automatic', 'amd' or 'metis'.");
}

void check_symmetric(const SparseMatrix& matrix) {
  check_square(matrix);
  const SparseMatrix mirrored = matrix.transpose();
  const SparseMatrix away = matrix - mirrored;
  double largest = 0.0;
  for (int c = 0; c < matrix.outerSize(); ++c) {
    for (SparseMatrix::InnerIterator it(matrix, c); it; ++it) {
      largest = std::max(largest, std::abs(it.value()));
    }
  }
  for (int c = 0; c < away.outerSize(); ++c) {
    for (SparseMatrix::InnerIterator it(away, c); it; ++it) {
      if (std::abs(it.value()) > 1e-10 * largest) {
        const std::string row = std::to_string(it.row()), column = std::to_string(it.col());
        throw Error(ErrorCode::not_positive_definite,
                    "The system is not symmetric: entry (" + row + ", " + column +
                        ") differs from entry (" + column + ", " + row +
                        "). Pass both triangles of a symmetric matrix.");
      }
    }
  }
}

bool is_ordering(const Eigen::VectorXi& ordering, Eigen::Index n) {
  std::vector<bool> seen(static_cast<size_t>(n), false);
  bool right = ordering.size() == n;
  for (Eigen::Index i = 0; right && i < n; ++i) {
    right = ordering[i] >= 0 && ordering[i] < n && !seen[static_cast<size_t>(ordering[i])];
    if (right) {
      seen[static_cast<size_t>(ordering[i])] = true;
    }
  }
  return right;
}

void throw_not_definite(Eigen::Index n) {
  throw Error(ErrorCode::not_positive_definite,
              "The " + std::to_string(n) + " x " + std::to_string(n) +
                  " system is not positive definite and cannot be factored.");
}

struct SymbolicCholesky::Impl {
  Backend backend = Backend::eigen;
  Eigen::Index size = 0, entries = 0;
  Eigen::VectorXi ordering;
#ifdef SUPPLE_WITH_CHOLMOD
  std::unique_ptr<const CholmodSymbolic> cholmod;
#endif
};

struct SparseCholesky::Impl {
  std::shared_ptr<const SymbolicCholesky> symbolic;
  std::unique_ptr<const Factor> factor;  // none for 0 x 0
};

bool SymbolicCholesky::available(Backend backend) {
#ifdef SUPPLE_WITH_CHOLMOD
  return backend == Backend::cholmod || backend == Backend::eigen;
#else
  return backend == Backend::eigen;
#endif
}

SymbolicCholesky::Backend SymbolicCholesky::default_backend() {
  return available(Backend::cholmod) ? Backend::cholmod : Backend::eigen;
}

SymbolicCholesky::SymbolicCholesky(const SparseMatrix& pattern, Backend backend,
                                   const Eigen::VectorXi& ordering) {
  analyse(pattern, backend, ordering, CholeskyOrdering::automatic);
}

SymbolicCholesky::SymbolicCholesky(const SparseMatrix& pattern, Backend backend,
                                   CholeskyOrdering method) {
  analyse(pattern, backend, {}, method);
}

void SymbolicCholesky::analyse(const SparseMatrix& pattern, Backend backend,
                               const Eigen::VectorXi& ordering, CholeskyOrdering method) {
  if (!available(backend)) {
    throw Error(ErrorCode::bad_option,
                "This build has no CHOLMOD. Use the Eigen backend or build with SuiteSparse.");
  }
  if (backend == Backend::eigen && method == CholeskyOrdering::metis) {
    throw Error(ErrorCode::bad_option,
                "The Eigen backend has no METIS. Use 'amd' or 'automatic', or CHOLMOD.");
  }
  check_square(pattern);
  if (ordering.size() > 0) {
    check_ordering(ordering, pattern.rows());
  }
  auto impl = std::make_unique<Impl>();
  impl->backend = backend;
  impl->size = pattern.rows();
  impl->entries = pattern.nonZeros();
  impl->ordering = ordering;
  if (pattern.nonZeros() > 0) {  // CHOLMOD cannot be shown an empty pattern
#ifdef SUPPLE_WITH_CHOLMOD
    if (backend == Backend::cholmod) {
      impl->cholmod = std::make_unique<const CholmodSymbolic>(pattern, ordering, method);
      impl->ordering = impl->cholmod->ordering();
    }
#endif
    if (backend == Backend::eigen && ordering.size() == 0) {
      impl->ordering = amd_ordering(pattern);
    }
  }
  impl_ = std::move(impl);
}

SymbolicCholesky::~SymbolicCholesky() = default;
SymbolicCholesky::Backend SymbolicCholesky::backend() const { return impl_->backend; }
Eigen::Index SymbolicCholesky::size() const { return impl_->size; }
const Eigen::VectorXi& SymbolicCholesky::ordering() const { return impl_->ordering; }

SparseCholesky::SparseCholesky(const SparseMatrix& matrix, Backend backend)
    : SparseCholesky(matrix, std::make_shared<const SymbolicCholesky>(matrix, backend)) {}

SparseCholesky::SparseCholesky(const SparseMatrix& matrix,
                               std::shared_ptr<const SymbolicCholesky> symbolic) {
  check_square(matrix);
  if (symbolic == nullptr) {
    symbolic = std::make_shared<const SymbolicCholesky>(matrix);
  }
  const SymbolicCholesky::Impl& shared = *symbolic->impl_;
  if (matrix.rows() != shared.size || matrix.nonZeros() != shared.entries) {
    throw Error(ErrorCode::wrong_shape,
                "The system has " + std::to_string(matrix.rows()) + " rows and " +
                    std::to_string(matrix.nonZeros()) + " entries, the pattern it is to share " +
                    std::to_string(shared.size) + " and " + std::to_string(shared.entries) + ".");
  }
  auto impl = std::make_unique<Impl>();
  if (matrix.rows() > 0) {
    if (matrix.nonZeros() == 0) {
      throw_not_definite(matrix.rows());
    }
#ifdef SUPPLE_WITH_CHOLMOD
    if (shared.backend == Backend::cholmod) {
      impl->factor = shared.cholmod->factor(matrix);
    }
#endif
    if (shared.backend == Backend::eigen) {
      impl->factor = std::make_unique<const EigenFactor>(matrix, shared.ordering);
    }
  }
  impl->symbolic = std::move(symbolic);
  impl_ = std::move(impl);
}

SparseCholesky::~SparseCholesky() = default;
SparseCholesky::SparseCholesky(SparseCholesky&&) noexcept = default;
SparseCholesky& SparseCholesky::operator=(SparseCholesky&&) noexcept = default;

Eigen::Index SparseCholesky::size() const { return impl_->symbolic->size(); }
SparseCholesky::Backend SparseCholesky::backend() const { return impl_->symbolic->backend(); }
const SymbolicCholesky& SparseCholesky::symbolic() const { return *impl_->symbolic; }
Eigen::Index SparseCholesky::factor_entries() const {
  return impl_->factor == nullptr ? 0 : impl_->factor->entries();
}

struct SparseCholesky::Solve {
  static RowMatrix<double> run(const SparseCholesky& cholesky, const RowMatrix<double>& rhs,
                               Substitution part, Precision precision) {
    if (rhs.rows() != cholesky.size()) {
      throw Error(ErrorCode::wrong_shape, "The system has " + std::to_string(cholesky.size()) +
                                              " rows, the right-hand side " +
                                              std::to_string(rhs.rows()) + ".");
    }
    const auto& factor = cholesky.impl_->factor;
    return factor == nullptr || rhs.cols() == 0 ? rhs : factor->solve(rhs, part, precision);
  }
};

RowMatrix<double> SparseCholesky::solve(const RowMatrix<double>& rhs, Precision precision) const {
  return Solve::run(*this, rhs, Substitution::both, precision);
}
RowMatrix<double> SparseCholesky::forward(const RowMatrix<double>& rhs, Precision precision) const {
  return Solve::run(*this, rhs, Substitution::forward, precision);
}
RowMatrix<double> SparseCholesky::backward(const RowMatrix<double>& half,
                                           Precision precision) const {
  return Solve::run(*this, half, Substitution::backward, precision);
}

}  // namespace supple
