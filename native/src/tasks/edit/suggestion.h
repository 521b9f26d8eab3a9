// SPDX-License-Identifier: GPL-3.0-or-later
// The smooth first guess of an edit.
#pragma once

#include <vector>

#include "supple/geometry/pinned_laplacian.h"

namespace supple {

/// A rigid motion of rows: v -> (v - from) rotation + to.
struct RigidMotion {
  Eigen::RowVector3d from = Eigen::RowVector3d::Zero(), to = from;
  Matrix3 rotation = Matrix3::Identity();
  Eigen::RowVector3d operator()(const Eigen::RowVector3d& point) const {
    return (point - from) * rotation + to;
  }
};

/// The rigid motion nearest to rest -> moved (k x 3 each); weights: k. turns: rotations that are
/// known besides, each times its weight; one of weight 1 counts like three more points at a tenth
/// of the surface's size, enough to decide where the points alone leave a turn open (one vertex, a
/// straight line).
RigidMotion nearest_motion(const Points& rest, const Points& moved, const Eigen::VectorXd& weights,
                           const std::vector<Matrix3>& turns);

/// Rotation of one place of a handle that is given by positions: that of the points around it,
/// near ones counting more; `otherwise` where they leave it open.
/// rest, moved: k x 3 of the handle, surface units; place: 3.
Matrix3 rotation_around(const Points& rest, const Points& moved, const Eigen::RowVector3d& place,
                        const Matrix3& otherwise);

/// n x 3: at each vertex the rotation vector of W^T R, with R between the rotations given at
/// `interpolation.points()` and W `whole`: biharmonic interpolation.
RowMatrix<double> interpolated_turns(const BiharmonicInterpolation& interpolation,
                                     const std::vector<Matrix3>& rotations, const Matrix3& whole);

/// Places among a handle's points (k x 3, surface units) that stand for all: far from each other,
/// at least 4 and at most 64 where there are so many. They depend on this handle alone.
std::vector<int> far_apart(const Points& points);

}  // namespace supple
