// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/sparse_cholesky.h"

#ifdef SUPPLE_WITH_CHOLMOD
#include <Eigen/CholmodSupport>
#endif
#include <Eigen/SparseCholesky>
#include <mutex>
#include <string>

#include "supple/core/error.h"

namespace supple {
namespace {

class Factor {
 public:
  virtual ~Factor() = default;
  virtual Eigen::MatrixXd solve(const Eigen::MatrixXd& rhs) const = 0;
};

void check(Eigen::ComputationInfo info, Eigen::Index n) {
  if (info != Eigen::Success) {
    throw Error(ErrorCode::not_positive_definite,
                "The " + std::to_string(n) + " x " + std::to_string(n) +
                    " system is not positive definite and cannot be factored.");
  }
}

class EigenFactor : public Factor {
 public:
  explicit EigenFactor(const SparseMatrix& matrix) : factor_(matrix) {
    check(factor_.info(), matrix.rows());
    // LDL^T also factors indefinite matrices; a definite one has a positive D.
    check((factor_.vectorD().array() > 0.0).all() ? Eigen::Success : Eigen::NumericalIssue,
          matrix.rows());
  }
  Eigen::MatrixXd solve(const Eigen::MatrixXd& rhs) const override { return factor_.solve(rhs); }

 private:
  Eigen::SimplicialLDLT<SparseMatrix> factor_;
};

#ifdef SUPPLE_WITH_CHOLMOD
class CholmodFactor : public Factor {
 public:
  explicit CholmodFactor(const SparseMatrix& matrix) {
    factor_.cholmod().print = 0;  // failures become errors, not text
    factor_.cholmod().final_ll = 1;
    factor_.compute(matrix);
    check(factor_.info(), matrix.rows());
  }
  Eigen::MatrixXd solve(const Eigen::MatrixXd& rhs) const override {
    const std::lock_guard lock(mutex_);  // CHOLMOD's workspace belongs to one solve at a time
    return factor_.solve(rhs);
  }

 private:
  mutable std::mutex mutex_;
  Eigen::CholmodDecomposition<SparseMatrix> factor_;
};
#endif

}  // namespace

struct SparseCholesky::Impl {
  Eigen::Index size = 0;
  Backend backend = Backend::eigen;
  std::unique_ptr<Factor> factor;
};

bool SparseCholesky::available(Backend backend) {
#ifdef SUPPLE_WITH_CHOLMOD
  return backend == Backend::cholmod || backend == Backend::eigen;
#else
  return backend == Backend::eigen;
#endif
}

SparseCholesky::Backend SparseCholesky::default_backend() {
  return available(Backend::cholmod) ? Backend::cholmod : Backend::eigen;
}

SparseCholesky::SparseCholesky(const SparseMatrix& matrix, Backend backend)
    : impl_(std::make_unique<Impl>()) {
  if (!available(backend)) {
    throw Error(ErrorCode::bad_option,
                "This build has no CHOLMOD. Use the Eigen backend or build with SuiteSparse.");
  }
  if (matrix.rows() != matrix.cols()) {
    throw Error(ErrorCode::wrong_shape, "The system is " + std::to_string(matrix.rows()) + " x " +
                                            std::to_string(matrix.cols()) + "; it must be square.");
  }
  if (matrix.rows() > 0 && matrix.nonZeros() == 0) {
    check(Eigen::NumericalIssue, matrix.rows());  // CHOLMOD cannot be shown an empty pattern
  }
  impl_->size = matrix.rows();
  impl_->backend = backend;
  if (matrix.rows() == 0) {
    return;
  }
#ifdef SUPPLE_WITH_CHOLMOD
  if (backend == Backend::cholmod) {
    impl_->factor = std::make_unique<CholmodFactor>(matrix);
    return;
  }
#endif
  impl_->factor = std::make_unique<EigenFactor>(matrix);
}

SparseCholesky::~SparseCholesky() = default;
SparseCholesky::SparseCholesky(SparseCholesky&&) noexcept = default;
SparseCholesky& SparseCholesky::operator=(SparseCholesky&&) noexcept = default;

Eigen::Index SparseCholesky::size() const { return impl_->size; }
SparseCholesky::Backend SparseCholesky::backend() const { return impl_->backend; }

Eigen::MatrixXd SparseCholesky::solve(const Eigen::MatrixXd& rhs) const {
  if (rhs.rows() != impl_->size) {
    throw Error(ErrorCode::wrong_shape, "The system has " + std::to_string(impl_->size) +
                                            " rows, the right-hand side " +
                                            std::to_string(rhs.rows()) + ".");
  }
  return impl_->size == 0 ? rhs : impl_->factor->solve(rhs);
}

}  // namespace supple
