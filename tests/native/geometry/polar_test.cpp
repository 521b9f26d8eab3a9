// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/LU>
#include <Eigen/SVD>

#include "native/support.h"
#include "supple/geometry/jacobians.h"

namespace supple {
namespace {

// The largest trace(Q^T J) over rotations: the sum of singular values, the smallest signed by det
// J. The sign is taken from the singular vectors: det J itself is rounding where J is nearly
// singular.
double best_trace(const Matrix3& j) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(j, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d s = svd.singularValues();
  const bool mirrored = svd.matrixU().determinant() * svd.matrixV().determinant() < 0.0;
  return s[0] + s[1] + (mirrored ? -s[2] : s[2]);
}

void expect_closest(const Matrix3& j, double tolerance = 1e-12) {
  const Matrix3 q = closest_rotation(j);
  EXPECT_LT((q.transpose() * q - Matrix3::Identity()).norm(), 1e-12) << "not orthogonal for\n" << j;
  EXPECT_NEAR(q.determinant(), 1.0, 1e-12) << "mirrored for\n" << j;
  EXPECT_NEAR(q.cwiseProduct(j).sum(), best_trace(j), tolerance * j.norm()) << "not closest for\n"
                                                                            << j;
}

Matrix3 with_singular_values(double a, double b, double c, uint64_t seed) {
  return test::rotation(seed) * Eigen::Vector3d(a, b, c).asDiagonal() * test::rotation(seed + 7);
}

TEST(ClosestRotation, OfRandomMatrices) {
  for (uint64_t seed = 0; seed < 2000; ++seed) {
    expect_closest(Matrix3(test::noise(3, 3, seed)));
  }
}

TEST(ClosestRotation, AgreesWithTheSingularVectors) {
  for (uint64_t seed = 0; seed < 50; ++seed) {
    const Matrix3 j = with_singular_values(2.0, 1.1, 0.4, seed);
    EXPECT_LT((closest_rotation(j) - test::rotation(seed) * test::rotation(seed + 7)).norm(),
              1e-12);
  }
}

TEST(ClosestRotation, OfMirroredMatrices) {
  for (uint64_t seed = 0; seed < 50; ++seed) {
    expect_closest(with_singular_values(2.0, 1.0, -0.4, seed));
    expect_closest(with_singular_values(2.0, -1.0, 1.0, seed));
  }
  expect_closest(-Matrix3::Identity());
}

TEST(ClosestRotation, OfSingularMatrices) {
  for (uint64_t seed = 0; seed < 50; ++seed) {
    expect_closest(with_singular_values(2.0, 1.0, 0.0, seed));
    expect_closest(with_singular_values(2.0, 0.0, 0.0, seed));
  }
  expect_closest(Matrix3::Zero());
}

TEST(ClosestRotation, OfNearlySingularMatrices) {
  for (const double small : {1e-6, 1e-8, 1e-9, 1e-10, 1e-12, 1e-15, 1e-17}) {
    for (uint64_t seed = 0; seed < 10; ++seed) {
      expect_closest(with_singular_values(2.0, 1.0, small, seed));
      expect_closest(with_singular_values(2.0, 1.0, -small, seed));
      expect_closest(with_singular_values(2.0, small, small, seed));
    }
  }
}

TEST(ClosestRotation, AtAnyScale) {
  for (const double scale : {1e-30, 1e-12, 1e12, 1e30}) {
    expect_closest(scale * with_singular_values(2.0, 1.1, 0.4, 3));
    expect_closest(scale * with_singular_values(2.0, 1.1, -0.4, 3));
  }
}

TEST(ClosestRotation, OfARotationIsItself) {
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const Matrix3 turn = test::rotation(seed);
    EXPECT_LT((closest_rotation(turn) - turn).cwiseAbs().maxCoeff(), 1e-15);
  }
}

TEST(ClosestRotation, TurnsWithItsMatrix) {
  const Matrix3 j = with_singular_values(1.7, 1.0, 0.6, 11);
  const Matrix3 r1 = test::rotation(1), r2 = test::rotation(2);
  EXPECT_LT((closest_rotation(r1.transpose() * j * r2) - r1.transpose() * closest_rotation(j) * r2)
                .norm(),
            1e-13);
}

TEST(PolarDecomposition, StretchIsSymmetricAndTheProductIsTheMatrix) {
  for (uint64_t seed = 0; seed < 200; ++seed) {
    const Matrix3 j = test::noise(3, 3, seed);
    const PolarDecomposition polar = polar_decomposition(j);
    EXPECT_LT((polar.stretch - polar.stretch.transpose()).norm(), 1e-12);
    EXPECT_LT((polar.stretch * polar.rotation - j).norm(), 1e-13);
  }
}

TEST(PolarDecomposition, OfAStretchAlongAnAxis) {
  const Matrix3 stretch = Eigen::Vector3d(3, 1, 0.5).asDiagonal();
  const Matrix3 turn = test::rotation(5);
  const PolarDecomposition polar = polar_decomposition(stretch * turn);
  EXPECT_LT((polar.stretch - stretch).norm(), 1e-13);
  EXPECT_LT((polar.rotation - turn).norm(), 1e-13);
}

}  // namespace
}  // namespace supple
