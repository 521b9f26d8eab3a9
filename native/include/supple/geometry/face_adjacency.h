// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "supple/core/types.h"
#include "supple/geometry/surface_operators.h"

namespace supple {

/// m x m, H: the mean of a face's neighbours, those that share an edge with it; rows sum to 1. A
/// face without neighbours is its own. Source: the paper's face-face incidence matrix, Eqn 14, its
/// rows divided by their sum, so that a field that is the same everywhere stays as it is.
SparseRowMatrix face_adjacency(const Faces& faces, const CornerTable& corners);

}  // namespace supple
