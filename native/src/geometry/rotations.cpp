// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/rotations.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cmath>

#include "supple/geometry/jacobians.h"

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

Matrix3 closest_rotation_backward(const Matrix3& j, const Matrix3& grad) {
  constexpr double kSmallest = 1e-9;  // of |J|: what counts as a sum of 0
  const PolarDecomposition polar = polar_decomposition(j);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(
      0.5 * (polar.stretch + polar.stretch.transpose()));
  const Matrix3 basis = eigen.eigenvectors();
  const Eigen::Vector3d& s = eigen.eigenvalues();
  // In the eigenvectors of W: dQ Q^T = skew(dJ Q^T) / (s_i + s_j).
  const Matrix3 turning = basis.transpose() * grad * polar.rotation.transpose() * basis;
  Matrix3 result = Matrix3::Zero();
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < a; ++b) {
      const double sum = s[a] + s[b];
      if (sum > kSmallest * j.norm()) {
        result(a, b) = (turning(a, b) - turning(b, a)) / sum;
        result(b, a) = -result(a, b);
      }
    }
  }
  return basis * result * basis.transpose() * polar.rotation;
}

}  // namespace supple
