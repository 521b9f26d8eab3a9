// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/signal.h"

#include <Eigen/LU>

#include "native/gradient_check.h"
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

class SpectralSignalGradient : public ::testing::TestWithParam<zoo::Entry> {
 protected:
  static constexpr int kCount = 8;
  SpectralSignalGradient()
      : operators(TriangleMesh(GetParam().mesh.vertices, GetParam().mesh.faces)),
        basis(eigenbasis(operators.laplacian, operators.mass, {.count = kCount})),
        source(basis.project(operators.vertices, kCount)),
        target(basis.project(test::bent(operators.vertices), kCount)) {
    for (uint64_t i = 0; i < 2; ++i) {
      weights.fields.push_back(test::noise(operators.faces.rows(), 9, 5 + i));
    }
  }

  double value() const {
    const Signal signal = spectral_signal(operators, source, target);
    return signal.fields[0].cwiseProduct(weights.fields[0]).sum() +
           signal.fields[1].cwiseProduct(weights.fields[1]).sum();
  }
  ::testing::AssertionResult check(const Points& analytic) {
    return test::gradient_matches([this] { return value(); }, test::values_of(target),
                                  test::values_of(analytic), 40, 1e-6);
  }

  SurfaceOperators operators;
  Eigenbasis basis;
  Points source, target;
  Signal weights;
};

TEST_P(SpectralSignalGradient, AgainstFiniteDifferences) {
  EXPECT_TRUE(check(spectral_signal_backward(operators, source, target, weights)));
}

TEST_P(SpectralSignalGradient, OfEachFieldAlone) {
  for (MatrixField& field : weights.fields) {
    const MatrixField before = field;
    field.setZero();
    EXPECT_TRUE(check(spectral_signal_backward(operators, source, target, weights)));
    field = before;
  }
}

TEST_P(SpectralSignalGradient, TheCheckCatchesAWrongOne) {
  // Each field's part too large by 1%: neither may hide behind the other.
  for (size_t i = 0; i < 2; ++i) {
    Signal wrong = weights;
    wrong.fields[i] *= 1.01;
    EXPECT_FALSE(check(spectral_signal_backward(operators, source, target, wrong))) << i;
  }
}

TEST_P(SpectralSignalGradient, AMovedTargetChangesNothing) {
  const Points gradient = spectral_signal_backward(operators, source, target, weights);
  EXPECT_LT(gradient.colwise().sum().norm(), 1e-9 * gradient.norm());
}

TEST_P(SpectralSignalGradient, AFlattenedFaceHasNoNormalToTurn) {
  // The corners of face 0 on one point: its frame is 0 but for edges, whose derivative stays.
  for (int c = 1; c < 3; ++c) {
    target.row(operators.faces(0, c)) = target.row(operators.faces(0, 0));
  }
  EXPECT_TRUE(spectral_signal_backward(operators, source, target, weights).allFinite());
  // Only the rest normal's part of the first field: it weighs the target's normal alone.
  for (MatrixField& field : weights.fields) {
    field.setZero();
  }
  matrix_at(weights.fields[0], 0) =
      operators.face_normals.row(0).transpose() * Eigen::RowVector3d(1.0, 2.0, 3.0);
  EXPECT_LT(spectral_signal_backward(operators, source, target, weights).norm(), 1e-12);
}

INSTANTIATE_TEST_SUITE_P(Meshes, SpectralSignalGradient,
                         ::testing::Values(zoo::Entry{.name = "sphere",
                                                      .mesh = zoo::perturbed_sphere(1, 3)},
                                           zoo::Entry{.name = "torus", .mesh = zoo::torus(10, 6)}),
                         test::entry_name);

TEST_F(Signals, BackwardSaysWhatDoesNotFit) {
  const Points& points = operators.vertices;
  const MatrixField field = MatrixField::Zero(operators.faces.rows(), 9);
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"two fields"}, [&] {
    spectral_signal_backward(operators, points, points, {{field}});
  }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"coarse target 3"}, [&] {
    spectral_signal_backward(operators, points, points.topRows(3), {{field, field}});
  }));
}

TEST_F(Signals, BackwardThroughTheWholeMeshsRotation) {
  // Faces whose coarse source is a point turn with the whole mesh; there that path is all there is.
  const Eigen::Index count = 6;
  Points coarse_source = basis.project(operators.vertices, count);
  Points coarse_target = basis.project(target, count);
  const int f = 0;
  for (int c = 1; c < 3; ++c) {
    coarse_source.row(operators.faces(f, c)) = coarse_source.row(operators.faces(f, 0));
  }
  Signal weights{
      {MatrixField::Zero(operators.faces.rows(), 9), MatrixField::Zero(operators.faces.rows(), 9)}};
  weights.fields[1].row(f) = test::noise(1, 9, 2);
  const Points analytic =
      spectral_signal_backward(operators, coarse_source, coarse_target, weights);
  EXPECT_GT(analytic.norm(), 0.01);
  EXPECT_TRUE(test::gradient_matches(
      [&] {
        return spectral_signal(operators, coarse_source, coarse_target)
            .fields[1]
            .cwiseProduct(weights.fields[1])
            .sum();
      },
      test::values_of(coarse_target), test::values_of(analytic), 40, 1e-6));
}

}  // namespace
}  // namespace supple
