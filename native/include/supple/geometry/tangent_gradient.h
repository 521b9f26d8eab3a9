// SPDX-License-Identifier: GPL-3.0-or-later
// Gradients at vertices, as two numbers in each vertex's tangent plane.
#pragma once

#include "supple/core/types.h"
#include "supple/geometry/surface_operators.h"

namespace supple {

/// n x 3: for each unit normal (n x 3) a unit vector at a right angle to it, the first axis of the
/// tangent frame; zero where the normal is. Which one has no meaning and does not turn with the
/// mesh: use only what does not depend on it.
Points tangent_axes(const Points& normals);

/// 2n x n: row v is the component along a = axes[v] and row n + v that along normal x a of the
/// gradient at vertex v, per unit of length: the area-weighted mean of the gradients on its faces,
/// projected to the plane at right angles to its normal. 0 where a vertex has no normal (faces that
/// cancel). axes: n x 3, as `tangent_axes` or turned about the normals. Errors: `wrong_shape`.
/// Source: Mancinelli, Livesu and Puppo 2018, "average gradient on star"; in frames as in Sharp,
/// Attaiki, Crane and Ovsjanikov 2022, section 3.4.
SparseRowMatrix tangent_gradient(const SurfaceOperators& operators, const Points& axes);

}  // namespace supple
