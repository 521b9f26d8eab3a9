// SPDX-License-Identifier: GPL-3.0-or-later
// Functions through values at any vertices, on one factor a mesh.
#pragma once

#include <Eigen/Cholesky>
#include <memory>
#include <vector>

#include "supple/core/types.h"
#include "supple/geometry/sparse_cholesky.h"

namespace supple {

/// The Laplacian of a mesh, factored with one vertex of each component pinned at 0: the least that
/// makes it definite, whatever the handles are.
class PinnedLaplacian {
 public:
  /// laplacian: n x n; mass: n; component: n labels in [0, component_count); symbolic: of the
  /// Laplacian's pattern; nullptr to analyse it here.
  PinnedLaplacian(const SparseMatrix& laplacian, Eigen::VectorXd mass, Eigen::VectorXi component,
                  int component_count, std::shared_ptr<const SymbolicCholesky> symbolic = nullptr);

  const Eigen::VectorXd& mass() const { return mass_; }
  const Eigen::VectorXi& component() const { return component_; }
  int component_count() const { return static_cast<int>(pins_.size()); }
  const SparseCholesky& factor() const { return factor_; }
  /// rows with those of the pinned vertices set to 0.
  RowMatrix<double> without_pins(RowMatrix<double> rows) const;

 private:
  Eigen::VectorXd mass_;
  Eigen::VectorXi component_, pins_;
  SparseCholesky factor_;
};

/// The smoothest functions through given values at some vertices: the least integral of (Delta
/// x)^2, Delta x = M^-1 W x. Source: Botsch and Kobbelt 2004, its kernel form: a point costs two
/// Laplace solves once, a function through its value then only a product; no bilaplacian is
/// factored.
class BiharmonicInterpolation {
 public:
  /// points: distinct indices in [0, n), at least one a component. former: of the same base; what
  /// the two share is not computed again. compliance: one a point, >= 0; empty for 0: how far the
  /// function may miss it, adding (x - value)^2 / compliance to what is least. Errors:
  /// `index_out_of_range`, `overlapping_handles` (a point twice), `no_handles` (a component without
  /// a point).
  BiharmonicInterpolation(std::shared_ptr<const PinnedLaplacian> base, Eigen::VectorXi points,
                          const BiharmonicInterpolation* former = nullptr,
                          Eigen::VectorXd compliance = {});

  const Eigen::VectorXi& points() const { return points_; }
  /// values: points x c. Returns n x c.
  RowMatrix<double> solve(const RowMatrix<double>& values) const;

 private:
  void find_kernels(const BiharmonicInterpolation* former);

  std::shared_ptr<const PinnedLaplacian> base_;
  Eigen::VectorXi points_;
  Eigen::VectorXi reference_;  // per point: the place in points_ of its component's first
  Eigen::VectorXi free_;       // places in points_ that are no reference
  // n x 8 each: Green's functions of the bilaplacian, G M (G - its mean), one column a point.
  std::vector<std::shared_ptr<const RowMatrix<double>>> kernels_;
  RowMatrix<double> gram_;      // points x points: the kernels at the points
  Eigen::VectorXd compliance_;  // a point
  Eigen::LLT<Eigen::MatrixXd> complement_;
};

}  // namespace supple
