// SPDX-License-Identifier: GPL-3.0-or-later
// What systems with held rows have in common.
#pragma once

#include "supple/core/types.h"

namespace supple {

/// Place of each of n rows among the held, or -1. Errors: `index_out_of_range`,
/// `overlapping_handles`.
Eigen::VectorXi held_slots(Eigen::Index n, const Eigen::VectorXi& held);
/// The matrix with the held rows and columns set to those of a diagonal one. Its pattern stays, so
/// that one analysis serves every set of held rows.
SparseMatrix with_held_rows(const SparseMatrix& matrix, const Eigen::VectorXi& held);
/// The first row of each component.
Eigen::VectorXi first_of_each(const Eigen::VectorXi& component, int count);

}  // namespace supple
