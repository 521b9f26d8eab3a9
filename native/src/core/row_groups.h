// SPDX-License-Identifier: GPL-3.0-or-later
// Rows of many numbers in an order in which neighbours are close to each other.
#pragma once

#include <vector>

#include "supple/core/tall.h"
#include "supple/core/types.h"

namespace supple {

/// The row numbers of `rows` in an order in which every `size` of them, from the first on, lie
/// close together: halved again and again along the number that differs most. Numbers further to
/// the right count less, as eigenfunctions oscillate faster the later they come. Finite rows; size
/// >= 1.
std::vector<int> grouped_rows(const ConstTallBlock<double>& rows, Eigen::Index size);

}  // namespace supple
