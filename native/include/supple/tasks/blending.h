// SPDX-License-Identifier: GPL-3.0-or-later
// How much of an edit is applied, and where.
#pragma once

#include "supple/core/types.h"
#include "supple/geometry/surface_operators.h"

namespace supple {

/// n x 3: rest + strength * weights * (posed - rest), row by row. weights: n, or empty for 1.
/// Errors: `wrong_shape`; `not_finite` for a strength that is not.
Points blend(const Points& rest, const Points& posed, double strength,
             const Eigen::VectorXd& weights);

/// n: 1 at the given surface vertices, falling smoothly (3 t^2 - 2 t^3) to 0 at `radius` from them,
/// in surface units; 0 on components without any. Distances are along edges (Dijkstra 1959), so up
/// to some 15% more than along the surface. radius > 0.
/// Errors: `bad_option`, `index_out_of_range`.
Eigen::VectorXd falloff_weights(const SurfaceOperators& operators, const Eigen::VectorXi& vertices,
                                double radius);

}  // namespace supple
