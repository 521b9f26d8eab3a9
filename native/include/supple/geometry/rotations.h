// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "supple/core/types.h"

namespace supple {

/// The rotation vector (axis times angle in [0, pi], radians) of a rotation matrix.
Eigen::RowVector3d rotation_vector(const Matrix3& rotation);
/// Its inverse, for any angle. Source: Rodrigues.
Matrix3 rotation_matrix(const Eigen::RowVector3d& vector);

}  // namespace supple
