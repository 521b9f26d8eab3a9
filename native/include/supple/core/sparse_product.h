// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "supple/core/types.h"

namespace supple {

/// a b, threads sharing the rows of a: the same bytes for any number of threads. Columns ascend in
/// each row.
SparseRowMatrix sparse_product(const SparseRowMatrix& a, const SparseRowMatrix& b);

/// The entries of each row that are at least `least` times the row's largest, in size, scaled to
/// sum to 1; rows whose entries sum to 0 stay unscaled.
SparseRowMatrix thinned(const SparseRowMatrix& matrix, double least);

}  // namespace supple
