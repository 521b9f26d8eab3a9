// SPDX-License-Identifier: GPL-3.0-or-later
// The eigenproblem W phi = lambda M phi in the form the solvers share.
#pragma once

#include <memory>

#include "supple/core/progress.h"
#include "supple/core/types.h"
#include "supple/geometry/sparse_cholesky.h"

namespace supple {

/// Eigenpairs of S = M^-1/2 W M^-1/2, values ascending.
struct Pairs {
  Eigen::VectorXd values;     ///< k
  RowMatrix<double> vectors;  ///< n x k, orthonormal
  Eigen::Index size() const { return values.size(); }
};

/// S, its kernel, and (S + shift)^-1.
class Eigenproblem {
 public:
  /// symbolic: of the Laplacian's pattern, or nullptr. The Laplacian must outlive this.
  Eigenproblem(const SparseMatrix& laplacian, const Eigen::VectorXd& mass,
               std::shared_ptr<const SymbolicCholesky> symbolic);

  Eigen::Index size() const { return root_mass_.size(); }
  const SparseMatrix& laplacian() const { return laplacian_; }
  const Eigen::VectorXd& mass() const { return mass_; }
  const SparseMatrix& symmetric() const { return symmetric_; }
  const Eigen::VectorXd& root_mass() const { return root_mass_; }
  double shift() const { return shift_; }
  const SparseCholesky& factor() const { return *factor_; }

  /// (S + shift)^-1 of n x c.
  RowMatrix<double> inverse(const RowMatrix<double>& block) const;

  /// Dimension of the kernel: one constant a connected component.
  Eigen::Index kernel_size() const { return static_cast<Eigen::Index>(component_mass_.size()); }
  /// n x min(limit, kernel_size): an orthonormal basis of the kernel, largest components first.
  RowMatrix<double> kernel(Eigen::Index limit) const;
  /// Takes the kernel's part out of each column.
  void leave_kernel(RowMatrix<double>& block) const;

  /// |S x - value x| / max(value, 1) of each pair.
  Eigen::VectorXd residuals(const Pairs& pairs) const;
  /// What rounding alone leaves of a residual: slivers make the matrix's norm, and this, large.
  double rounding_floor() const;

 private:
  void find_components();

  const SparseMatrix& laplacian_;  // not owned
  Eigen::VectorXd mass_, root_mass_;
  SparseMatrix symmetric_;
  double shift_;
  std::unique_ptr<const SparseCholesky> factor_;
  Eigen::VectorXi component_;  // n, numbered by falling mass
  std::vector<double> component_mass_;
};

}  // namespace supple
