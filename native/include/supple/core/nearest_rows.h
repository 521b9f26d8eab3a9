// SPDX-License-Identifier: GPL-3.0-or-later
// Nearest neighbours among rows of many numbers, where search trees are of no use.
#pragma once

#include "supple/core/progress.h"
#include "supple/core/tall.h"
#include "supple/core/types.h"

namespace supple {

/// For each row of `queries` (q x k), the nearest row of `points` (p x k, p >= 1) by Euclidean
/// distance, ties to the lowest index: exactly what comparing every sum of squared differences in
/// double precision finds, for norms between 1e-150 and 1e150. Products in single precision leave
/// the few rows that this is done for. Rows are put into groups that lie close together, and far
/// groups passed over: quickest where the first numbers vary slowest from row to row, as those of
/// eigenfunctions do. Memory: both once more in single precision, and some 40 p floats a thread.
/// Errors: `wrong_shape`, `not_finite`; `cancelled`.
Eigen::VectorXi nearest_rows(const ConstTallBlock<double>& queries,
                             const ConstTallBlock<double>& points, ProgressRange progress = {});

}  // namespace supple
