// SPDX-License-Identifier: GPL-3.0-or-later
// Closest rotations of a whole field, which kernels of their own find several at a time.
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "native/support.h"
#include "supple/geometry/jacobians.h"

namespace supple {
namespace {

Matrix3 with_singular_values(double a, double b, double c, uint64_t seed) {
  return test::rotation(seed) * Eigen::Vector3d(a, b, c).asDiagonal() * test::rotation(seed + 7);
}

// The singular values, the last one signed as the matrix is turned over.
Eigen::Vector3d signed_values(const Matrix3& j) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(j, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d s = svd.singularValues();
  s[2] *= svd.matrixU().determinant() * svd.matrixV().determinant() < 0.0 ? -1.0 : 1.0;
  return s;
}

MatrixField field_of(const std::vector<Matrix3>& matrices) {
  MatrixField field(static_cast<Eigen::Index>(matrices.size()), 9);
  for (Eigen::Index f = 0; f < field.rows(); ++f) {
    matrix_at(field, f) = matrices[static_cast<size_t>(f)];
  }
  return field;
}

// The closest rotation moves by at most 2 |dJ| / (s2 + s3) for a change dJ of J (Soderkvist 1993),
// and rounding changes J by a few 1e-16 |J|.
void expect_one_by_one(const MatrixField& field) {
  const MatrixField rotations = closest_rotations(field);
  ASSERT_EQ(rotations.rows(), field.rows());
  for (Eigen::Index f = 0; f < field.rows(); ++f) {
    const Matrix3 j = matrix_at(field, f), expected = closest_rotation(j);
    const Eigen::Vector3d s = signed_values(j);
    const double tolerance = std::max(1e-14, 1e-14 * s.norm() / (s[1] + s[2]));
    EXPECT_LT((matrix_at(rotations, f) - expected).norm(), tolerance) << "matrix " << f << "\n"
                                                                      << j;
  }
}

// Where the closest rotation is not unique: a rotation, and none is closer.
void expect_closest(const MatrixField& field) {
  const MatrixField rotations = closest_rotations(field);
  for (Eigen::Index f = 0; f < field.rows(); ++f) {
    const Matrix3 q = matrix_at(rotations, f), j = matrix_at(field, f);
    EXPECT_LT((q.transpose() * q - Matrix3::Identity()).norm(), 1e-12) << j;
    EXPECT_NEAR(q.determinant(), 1.0, 1e-12) << j;
    EXPECT_NEAR(q.cwiseProduct(j).sum(), signed_values(j).sum(), 1e-12 * j.norm()) << j;
  }
}

void check_random() { expect_one_by_one(test::noise(1003, 9, 1)); }

void check_counts() {
  for (const Eigen::Index count : {0, 1, 2, 3, 4, 5, 7, 8, 9, 12, 15, 16, 17}) {
    expect_one_by_one(test::noise(count, 9, 100 + static_cast<uint64_t>(count)));
  }
}

void check_hard() {
  std::vector<Matrix3> matrices;
  for (uint64_t seed = 0; seed < 20; ++seed) {
    matrices.push_back(with_singular_values(2.0, 1.0, 0.0, seed));
    matrices.push_back(with_singular_values(2.0, 1.0, -0.4, seed));
    matrices.push_back(with_singular_values(1.0, 0.5, -0.45, seed));
    matrices.push_back(with_singular_values(3.0, 0.2, 0.1, seed));
    for (const double small : {1e-6, 1e-9, 1e-12, 1e-15}) {
      matrices.push_back(with_singular_values(2.0, 1.0, small, seed));
      matrices.push_back(with_singular_values(2.0, 1.0, -small, seed));
    }
    matrices.push_back(test::rotation(seed));
  }
  for (const double scale : {1e-8, 1.0, 1e8}) {
    expect_one_by_one(scale * field_of(matrices));
  }
}

void check_ambiguous() {
  std::vector<Matrix3> matrices = {Matrix3::Zero(), -Matrix3::Identity(), Matrix3::Ones()};
  for (uint64_t seed = 0; seed < 20; ++seed) {
    matrices.push_back(with_singular_values(2.0, 0.0, 0.0, seed));
    matrices.push_back(with_singular_values(2.0, 1e-9, 1e-9, seed));
    matrices.push_back(with_singular_values(2.0, 1.0, -1.0, seed));
    matrices.push_back(Matrix3::Zero());
  }
  for (const double scale : {1e-8, 1.0, 1e8}) {
    expect_closest(scale * field_of(matrices));
  }
}

TEST(ClosestRotations, OfRandomMatricesAreThoseOneByOne) { check_random(); }
TEST(ClosestRotations, OfAnyNumberOfMatrices) { check_counts(); }
TEST(ClosestRotations, OfSingularMirroredAndScaledMatrices) { check_hard(); }
TEST(ClosestRotations, AreClosestWhereSeveralAre) { check_ambiguous(); }

TEST(ClosestRotations, OfZeroAreRotations) {
  const MatrixField rotations = closest_rotations(MatrixField::Zero(11, 9));
  for (Eigen::Index f = 0; f < rotations.rows(); ++f) {
    EXPECT_NEAR(matrix_at(rotations, f).determinant(), 1.0, 1e-15);
  }
}

TEST(ClosestRotations, AMatrixDoneByItselfLeavesItsNeighboursAlone) {
  MatrixField field = test::noise(16, 9, 1);
  const MatrixField expected = closest_rotations(field);
  field.row(5).setZero();
  const MatrixField got = closest_rotations(field);
  for (Eigen::Index f = 0; f < field.rows(); ++f) {
    if (f != 5) {
      EXPECT_LT((got.row(f) - expected.row(f)).norm(), 1e-13) << f;
    }
  }
}

TEST(ClosestRotations, AtEverySimdLevel) {
  test::at_every_simd_level([] {
    check_random();
    check_counts();
    check_hard();
    check_ambiguous();
  });
}

}  // namespace
}  // namespace supple
