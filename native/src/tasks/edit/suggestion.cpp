// SPDX-License-Identifier: GPL-3.0-or-later
#include "suggestion.h"

#include <algorithm>
#include <cmath>

#include "supple/geometry/jacobians.h"
#include "supple/geometry/rotations.h"

namespace supple {

RigidMotion nearest_motion(const Points& rest, const Points& moved, const Eigen::VectorXd& weights,
                           const std::vector<Matrix3>& turns) {
  constexpr double kRadius = 0.1;
  RigidMotion motion;
  motion.from = weights.transpose() * rest / weights.sum();
  motion.to = weights.transpose() * moved / weights.sum();
  Matrix3 correlation = (rest.rowwise() - motion.from).transpose() * weights.asDiagonal() *
                        (moved.rowwise() - motion.to);
  for (const Matrix3& turn : turns) {
    correlation += kRadius * kRadius * turn;
  }
  // Where a turn is still open, the smallest.
  correlation += 1e-13 * correlation.norm() * Matrix3::Identity();
  if (correlation.norm() > 0.0) {
    motion.rotation = closest_rotation(correlation);
  }
  return motion;
}

Matrix3 rotation_around(const Points& rest, const Points& moved, const Eigen::RowVector3d& place,
                        const Matrix3& otherwise) {
  constexpr double kReach = 0.1;  // of the root of the area
  constexpr double kOpen = 0.01;  // weight of `otherwise`
  const Eigen::VectorXd weight =
      (-(rest.rowwise() - place).rowwise().squaredNorm() / (kReach * kReach)).array().exp();
  const double total = weight.sum();
  const Eigen::RowVector3d from = weight.transpose() * rest / total;
  const Eigen::RowVector3d to = weight.transpose() * moved / total;
  Matrix3 correlation =
      (rest.rowwise() - from).transpose() * weight.asDiagonal() * (moved.rowwise() - to);
  const double size = correlation.norm();
  if (!(size > 0.0)) {
    return otherwise;
  }
  return closest_rotation(correlation / size + kOpen * otherwise);
}

RowMatrix<double> interpolated_turns(const BiharmonicInterpolation& interpolation,
                                     const std::vector<Matrix3>& rotations, const Matrix3& whole) {
  RowMatrix<double> vectors(static_cast<Eigen::Index>(rotations.size()), 3);
  for (size_t i = 0; i < rotations.size(); ++i) {
    vectors.row(static_cast<Eigen::Index>(i)) = rotation_vector(whole.transpose() * rotations[i]);
  }
  return interpolation.solve(vectors);
}

std::vector<int> far_apart(const Points& points) {
  constexpr Eigen::Index kFewest = 4, kMost = 64;
  constexpr double kNear = 0.06;  // of the root of the area
  std::vector<int> chosen;
  Eigen::VectorXd distance = (points.rowwise() - points.colwise().mean()).rowwise().squaredNorm();
  while (static_cast<Eigen::Index>(chosen.size()) < std::min(points.rows(), kMost)) {
    Eigen::Index next = 0;
    const double farthest = distance.maxCoeff(&next);
    if (static_cast<Eigen::Index>(chosen.size()) >= kFewest && farthest < kNear * kNear) {
      break;
    }
    const Eigen::VectorXd from_next = (points.rowwise() - points.row(next)).rowwise().squaredNorm();
    distance = chosen.empty() ? from_next : distance.cwiseMin(from_next).eval();
    distance[next] = -1.0;  // never again, though another may lie on it
    chosen.push_back(static_cast<int>(next));
  }
  return chosen;
}

}  // namespace supple
