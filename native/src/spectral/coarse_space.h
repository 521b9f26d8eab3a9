// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "supple/core/types.h"

namespace supple {

/// The Laplacian of a mesh seen through fewer, smooth functions: those that `prolongation` has in
/// its columns.
struct CoarseSpace {
  SparseMatrix laplacian;        ///< c x c, P^T W P
  Eigen::VectorXd mass;          ///< c, positive: P^T M 1
  SparseRowMatrix prolongation;  ///< n x c, P; its rows sum to 1
};

/// laplacian: n x n, symmetric; mass: n, positive. rings: of the neighbourhood that a column stands
/// for; 1, where c is about n / 8 on a triangle mesh, or 2, about n / 25.
///
/// Columns are near hat functions of some vertices, their roots: 1 at the root and 0 at the others,
/// about harmonic between them, then smoothed a little. The cotangent Laplacian of a plane takes
/// linear functions to 0, so they are near the space. Smoothed aggregation (Vanek, Mandel and
/// Brezina 1996) has constants alone, and eigenvalues that are off by 70% however fine it is.
CoarseSpace coarse_space(const SparseMatrix& laplacian, const Eigen::VectorXd& mass, int rings);

}  // namespace supple
