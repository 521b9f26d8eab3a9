// SPDX-License-Identifier: GPL-3.0-or-later
// Shift-invert Lanczos by Spectra, one vector at a time: the reference for the block method.
#pragma once

#include "eigenproblem.h"
#include "supple/core/progress.h"

namespace supple {

/// The `count` pairs of smallest value, kernel left out, orthogonal to the columns of `locked`;
/// fewer where not all converged within `max_restarts`.
Pairs lanczos(const Eigenproblem& problem, const RowMatrix<double>& locked, Eigen::Index count,
              int max_restarts, const ProgressRange& progress);

}  // namespace supple
