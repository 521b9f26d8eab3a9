// SPDX-License-Identifier: GPL-3.0-or-later
// Multiple eigenvalues, found whole.
#pragma once

#include <cstdint>
#include <functional>

#include "eigenproblem.h"

namespace supple {

/// A solver: the `wanted` pairs of smallest value, kernel left out, orthogonal to the columns of
/// `locked`, from another start for another seed; fewer where not all converged.
using PairSearch =
    std::function<Pairs(const RowMatrix<double>& locked, Eigen::Index wanted, uint64_t seed)>;

/// The pairs of both, ascending, the first `count` of them.
Pairs merged(const Pairs& a, const Pairs& b, Eigen::Index count);

/// The `count` pairs of smallest value, kernel left out; fewer where the searches find no more. A
/// block method finds as many copies of an eigenvalue as a block has vectors (`together`), a single
/// vector finds one by right and more by rounding: the rest is in the complement, which is searched
/// where so many values are within `same`, relative to their size.
Pairs with_all_copies(const Eigenproblem& problem, Eigen::Index count, Eigen::Index together,
                      double same, const PairSearch& search);

}  // namespace supple
