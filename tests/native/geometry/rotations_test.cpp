// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/rotations.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "native/gradient_check.h"
#include "native/support.h"
#include "supple/geometry/jacobians.h"

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

// A matrix of singular values a, b, |c|, mirrored where c < 0.
Matrix3 with_singular_values(double a, double b, double c, uint64_t seed) {
  return test::rotation(seed) * Eigen::Vector3d(a, b, c).asDiagonal() * test::rotation(seed + 7);
}

// `factor` times the derivative, against differences of a random functional of the rotation.
::testing::AssertionResult closest_rotation_gradient_matches(Matrix3 j, double factor = 1.0) {
  const Matrix3 weights = test::noise(3, 3, 11);
  const Matrix3 analytic = factor * closest_rotation_backward(j, weights);
  return test::gradient_matches([&] { return closest_rotation(j).cwiseProduct(weights).sum(); },
                                test::values_of(j), test::values_of(analytic), 9, 1e-7);
}

TEST(ClosestRotationBackward, AgainstFiniteDifferences) {
  for (uint64_t seed = 0; seed < 5; ++seed) {
    for (const Eigen::Vector3d& s : {Eigen::Vector3d(1.3, 0.9, 0.4), Eigen::Vector3d(1.0, 1.0, 1.0),
                                     Eigen::Vector3d(2.0, 0.7, 0.7), Eigen::Vector3d(1.0, 0.6, 0.0),
                                     Eigen::Vector3d(1.5, 0.9, -0.4)}) {
      const Matrix3 j = with_singular_values(s[0], s[1], s[2], seed);
      EXPECT_TRUE(closest_rotation_gradient_matches(j)) << s.transpose() << ", seed " << seed;
      EXPECT_FALSE(closest_rotation_gradient_matches(j, 1.01)) << s.transpose();
    }
  }
}

TEST(ClosestRotationBackward, AtARotationIsTheSkewPart) {
  const Matrix3 q = test::rotation(4), grad = test::noise(3, 3, 3);
  const Matrix3 expected = 0.5 * (grad - q * grad.transpose() * q);
  EXPECT_LT((closest_rotation_backward(q, grad) - expected).norm(), 1e-14);
}

TEST(ClosestRotationBackward, DoesNotSeeASymmetricStretch) {
  // J = W Q: a change dW Q leaves Q.
  const Matrix3 j = with_singular_values(1.3, 0.9, 0.4, 2), grad = test::noise(3, 3, 3);
  const Matrix3 noise = test::noise(3, 3, 5);
  const Matrix3 change = (noise + noise.transpose()) * closest_rotation(j);
  EXPECT_NEAR(closest_rotation_backward(j, grad).cwiseProduct(change).sum(), 0.0, 1e-14);
}

TEST(ClosestRotationBackward, IsZeroInTurnsThatAreNotDetermined) {
  const Matrix3 grad = test::noise(3, 3, 3);
  EXPECT_EQ(closest_rotation_backward(Matrix3::Zero(), grad), Matrix3::Zero());
  // About its first axis, a matrix of rank one may be turned freely, and so may one mirrored there.
  for (const Eigen::Vector3d& s :
       {Eigen::Vector3d(2.0, 0.0, 0.0), Eigen::Vector3d(2.0, 0.5, -0.5)}) {
    const Matrix3 left = test::rotation(1), right = test::rotation(6);
    const Matrix3 j = left * s.asDiagonal() * right;
    const Matrix3 got = closest_rotation_backward(j, grad);
    EXPECT_TRUE(got.allFinite());
    const Matrix3 inside = left.transpose() * got * closest_rotation(j).transpose() * left;
    EXPECT_NEAR(inside(1, 2), 0.0, 1e-8) << s.transpose();
    EXPECT_GT(std::abs(inside(0, 1)) + std::abs(inside(0, 2)), 0.01) << s.transpose();
  }
}

}  // namespace
}  // namespace supple
