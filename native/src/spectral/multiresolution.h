// SPDX-License-Identifier: GPL-3.0-or-later
// Eigenfunctions of a large mesh from those of a coarse space.
#pragma once

#include "eigenproblem.h"
#include "supple/core/progress.h"

namespace supple {

/// The `count` pairs of smallest value, kernel left out, each with |S x - value x| <= residual *
/// max(value, 1). None where the mesh has too few vertices for a coarse space with room for them;
/// fewer where the coarse solver finds fewer.
///
/// The mesh is coarsened algebraically (`coarse_space`), the coarse eigenproblem solved exactly,
/// its functions prolonged, and corrected by one or two inverse iterations with Rayleigh-Ritz on
/// the fine factor. One iteration takes an error along an eigenfunction of value v down by value /
/// v, so what a coarse space misses, being rough, goes first.
Pairs multiresolution(const Eigenproblem& problem, Eigen::Index count, double residual,
                      const ProgressRange& progress);

}  // namespace supple
