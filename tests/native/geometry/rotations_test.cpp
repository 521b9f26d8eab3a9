// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/rotations.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "native/support.h"

namespace supple {
namespace {

constexpr double kPi = std::numbers::pi;

Eigen::RowVector3d axis(uint64_t seed) {
  return Eigen::RowVector3d(test::noise(1, 3, seed).row(0)).normalized();
}

const std::vector<double> kAngles = {0.0, 1e-12, 1e-8, 1e-5,       9.9e-5,     1e-4,       1.1e-4,
                                     0.3, 1.5,   3.0,  kPi - 1e-3, kPi - 1e-6, kPi - 1e-9, kPi};

TEST(RotationMatrix, IsThatOfTheAxisAndTheAngle) {
  for (uint64_t seed = 0; seed < 20; ++seed) {
    for (const double angle : kAngles) {
      const Eigen::RowVector3d u = axis(seed);
      const Matrix3 got = rotation_matrix(angle * u);
      const Eigen::Matrix3d expected = Eigen::AngleAxisd(angle, u.transpose()).toRotationMatrix();
      EXPECT_LT((got - expected).norm(), 1e-14) << "angle " << angle;
    }
  }
}

TEST(RotationMatrix, OfMoreThanATurn) {
  for (const double angle : {4.0, 2.0 * kPi, 7.0, 20.0}) {
    const Eigen::RowVector3d u = axis(3);
    EXPECT_LT((rotation_matrix(angle * u) -
               Matrix3(Eigen::AngleAxisd(angle, u.transpose()).toRotationMatrix()))
                  .norm(),
              1e-14 * angle);
  }
}

TEST(RotationMatrix, OfATinyVectorKeepsItsDigits) {
  // R - 1 is the cross product matrix to second order: its digits are those of the vector.
  for (const double angle : {1e-12, 1e-9, 1e-6}) {
    const Eigen::RowVector3d w = angle * axis(5);
    const Matrix3 r = rotation_matrix(w);
    const Eigen::RowVector3d odd(0.5 * (r(2, 1) - r(1, 2)), 0.5 * (r(0, 2) - r(2, 0)),
                                 0.5 * (r(1, 0) - r(0, 1)));
    EXPECT_LT((odd - w).norm(), 1e-12 * angle) << angle;
  }
}

TEST(RotationVector, GivesBackTheVector) {
  for (uint64_t seed = 0; seed < 20; ++seed) {
    for (const double angle : kAngles) {
      const Eigen::RowVector3d w = angle * axis(seed);
      const Eigen::RowVector3d got = rotation_vector(rotation_matrix(w));
      // Half a turn about an axis is the one about its opposite.
      const double apart =
          std::min((got - w).norm(), angle > kPi - 1e-8 ? (got + w).norm() : (got - w).norm());
      // From the matrix through a quaternion: rounding of 1e-16 in it, nowhere amplified.
      EXPECT_LT(apart, 1e-14) << "angle " << angle << ", seed " << seed;
    }
  }
}

TEST(RotationVector, IsNoLongerThanHalfATurn) {
  for (uint64_t seed = 0; seed < 50; ++seed) {
    const Eigen::RowVector3d w = (0.3 * static_cast<double>(seed)) * axis(seed);
    const Matrix3 r = rotation_matrix(w);
    const Eigen::RowVector3d got = rotation_vector(r);
    EXPECT_LE(got.norm(), kPi + 1e-14);
    EXPECT_LT((rotation_matrix(got) - r).norm(), 1e-13) << seed;
  }
}

TEST(RotationVector, OfTheIdentityIsZero) {
  EXPECT_EQ(rotation_vector(Matrix3::Identity()).norm(), 0.0);
}

}  // namespace
}  // namespace supple
