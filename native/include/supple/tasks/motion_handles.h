// SPDX-License-Identifier: GPL-3.0-or-later
// Handles from a motion: where a mesh and the same mesh later differ most.
#pragma once

#include <optional>
#include <vector>

#include "supple/tasks/prepared_mesh.h"

namespace supple {

/// Places for handles that carry the motion from a mesh to moved vertices (n x 3, the caller's
/// units): mesh vertices of each, ascending, 0-based, in the order in which they were found. The
/// paper's second experiment takes the vertices that move farthest; here they are spread as well.
///
/// The nearest rigid motion of the whole (mass-weighted, Kabsch 1976) is taken out. Next is always
/// the vertex that then moves farthest among those a spacing or more from all before, along edges;
/// the spacing is the root of the area first and halves when no vertex is left. So every piece gets
/// its handle before any gets a second, and places that hardly move are held as well, once those
/// that move have theirs. Ties go to the lowest index.
///
/// count: at least 1; fewer come back where no more fit. radius: what lies within it along edges
/// (Dijkstra 1959) belongs to a handle, caller's units; 0 for single vertices; by default 0.03 of
/// the root of the area, with which 16 handles cover some 4%. Handles share no vertex and no edge
/// joins two of them. Errors: `wrong_shape`, `not_finite`, `bad_option`; `no_handles` where nothing
/// moves but the whole.
std::vector<Eigen::VectorXi> propose_motion_handles(const PreparedMesh& prepared,
                                                    const Points& moved, int count = 16,
                                                    std::optional<double> radius = {});

}  // namespace supple
