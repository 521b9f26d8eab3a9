// SPDX-License-Identifier: GPL-3.0-or-later
// The rotations of a pose's faces, and those from one pose to the next. m faces.
#pragma once

#include <vector>

#include "supple/core/types.h"
#include "supple/geometry/surface_operators.h"

namespace supple {

/// m x 9: closest rotations to the Jacobians of moved n x 3 vertices. A face without area there has
/// no rotation of its own and takes the mean of its neighbours'.
MatrixField pose_rotations(const SurfaceOperators& operators, const Points& moved,
                           const MatrixField& jacobians);

/// Of the rotation vectors that mean the same rotation as `vector` (of an angle up to pi), which
/// differ by whole turns about its axis, the nearest to another one.
Eigen::RowVector3d nearest_turn(const Eigen::RowVector3d& vector, const Eigen::RowVector3d& other);

/// m x 3: a rotation vector w for each face with to = from exp(w) (m x 9 each), such that faces
/// that share an edge have the nearest to each other's: an angle may be beyond pi. guides: for each
/// component the face of a component without a guide whose vector it stays nearest to; -1 for none,
/// then its area-weighted mean angle is the least.
Points turns_between(const SurfaceOperators& operators, const MatrixField& from,
                     const MatrixField& to, const std::vector<int>& guides);

}  // namespace supple
