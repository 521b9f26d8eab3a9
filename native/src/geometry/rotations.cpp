// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/rotations.h"

#include <Eigen/Geometry>
#include <cmath>

namespace supple {

Eigen::RowVector3d rotation_vector(const Matrix3& rotation) {
  const Eigen::AngleAxisd turn{Eigen::Matrix3d(rotation)};
  return turn.angle() * turn.axis().transpose();
}

Matrix3 rotation_matrix(const Eigen::RowVector3d& vector) {
  const double square = vector.squaredNorm(), angle = std::sqrt(square);
  // Series where the quotients lose their digits.
  const double s = angle < 1e-4 ? 1.0 - square / 6.0 : std::sin(angle) / angle;
  const double c = angle < 1e-4 ? 0.5 - square / 24.0 : (1.0 - std::cos(angle)) / square;
  Matrix3 cross;
  cross << 0.0, -vector[2], vector[1], vector[2], 0.0, -vector[0], -vector[1], vector[0], 0.0;
  return Matrix3::Identity() + s * cross + c * cross * cross;
}

}  // namespace supple
