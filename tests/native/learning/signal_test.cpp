// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/signal.h"

#include <Eigen/LU>

#include "native/support.h"
#include "supple/geometry/jacobians.h"

namespace supple {
namespace {

class Signals : public ::testing::Test {
 protected:
  Signals()
      : operators(TriangleMesh(mesh.vertices, mesh.faces)),
        basis(eigenbasis(operators.laplacian, operators.mass, {.count = 40})),
        target(test::bent(operators.vertices)) {}

  zoo::Mesh mesh = zoo::perturbed_sphere(2, 8);
  SurfaceOperators operators;
  Eigenbasis basis;
  Points target;
};

void expect_rotations(const MatrixField& field) {
  for (Eigen::Index f = 0; f < field.rows(); ++f) {
    const Matrix3 q = matrix_at(field, f);
    EXPECT_LT((q * q.transpose() - Matrix3::Identity()).norm(), 1e-12);
    EXPECT_GT(q.determinant(), 0.0);
  }
}

void expect_turned(const MatrixField& got, const MatrixField& field, const Matrix3& r1,
                   const Matrix3& r2) {
  for (Eigen::Index f = 0; f < field.rows(); ++f) {
    EXPECT_LT((matrix_at(got, f) - r1.transpose() * matrix_at(field, f) * r2).norm(), 1e-8);
  }
}

TEST_F(Signals, RotationsAreRotations) {
  const Signal signal = rotation_signal(operators.jacobians_of(target));
  ASSERT_EQ(static_cast<int>(signal.fields.size()), field_count(SignalKind::rotation));
  expect_rotations(signal.fields.front());
}

TEST_F(Signals, SpectralFieldsStartWithTheJacobian) {
  const Points coarse = basis.project(target, 20);
  const Signal signal = spectral_signal(operators, basis, coarse, 20);
  ASSERT_EQ(static_cast<int>(signal.fields.size()), field_count(SignalKind::spectral));
  EXPECT_EQ(signal.fields.front(), operators.jacobians_of(coarse));
}

TEST_F(Signals, TheSecondFieldOfARigidMotionIsItsRotation) {
  // Both sides have lost the same detail, so what is left is the motion itself.
  const Matrix3 turn = test::rotation(2);
  const Points coarse = basis.project(operators.vertices * turn, 20);
  const Signal signal = spectral_signal(operators, basis, coarse, 20);
  for (Eigen::Index f = 0; f < signal.fields.back().rows(); ++f) {
    EXPECT_LT((matrix_at(signal.fields.back(), f) - turn).norm(), 1e-10);
  }
}

TEST_F(Signals, TurnWithSourceAndTarget) {
  const Matrix3 r1 = test::rotation(1), r2 = test::rotation(5);
  const SurfaceOperators other{TriangleMesh(Points(mesh.vertices * r1), mesh.faces)};
  const Eigenbasis other_basis = eigenbasis(other.laplacian, other.mass, {.count = 40});
  const Eigen::Index count = basis.stable_count(20);
  const Signal a = spectral_signal(operators, basis, basis.project(target, count), count);
  const Signal b =
      spectral_signal(other, other_basis, other_basis.project(target * r2, count), count);
  for (size_t i = 0; i < 2; ++i) {
    expect_turned(b.fields[i], a.fields[i], r1, r2);
  }
  expect_turned(rotation_signal(other.jacobians_of(target * r2)).fields[0],
                rotation_signal(operators.jacobians_of(target)).fields[0], r1, r2);
}

TEST_F(Signals, SpectralTargetOfTheSameShapeIsItsProjection) {
  const Points coarse = spectral_target(basis, basis, operators.vertices, 15);
  EXPECT_LT(test::farthest(coarse, basis.project(operators.vertices, 15)), 1e-10);
}

}  // namespace
}  // namespace supple
