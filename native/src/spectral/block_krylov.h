// SPDX-License-Identifier: GPL-3.0-or-later
// Shift-invert block Krylov-Schur method (Stewart 2002; Zhou and Saad 2008) on the Cholesky factor.
#pragma once

#include "eigenproblem.h"
#include "supple/core/progress.h"

namespace supple {

struct BlockKrylovOptions {
  Eigen::Index count = 128;
  double tolerance = 1e-9;  ///< of |S x - value x| / (value + shift), estimated
  int max_restarts = 50;
  uint64_t seed = 1;
};

/// The `count` pairs of smallest value, kernel left out, orthogonal to the n x l orthonormal
/// columns of `locked` (l may be 0). Fewer where the space ends, or where the restarts do.
///
/// Blocks, because one product or solve with 8 vectors takes little longer than with one: the
/// factor and the basis are read once for all of them. With more than 8, the space has to become
/// so much larger that it takes longer. About 3.3 * count dimensions are enough.
Pairs block_krylov(const Eigenproblem& problem, const RowMatrix<double>& locked,
                   const BlockKrylovOptions& options, const ProgressRange& progress);

/// Vectors multiplied at once. An eigenvalue met more often than this may not be found whole.
Eigen::Index block_width(Eigen::Index count);

}  // namespace supple
