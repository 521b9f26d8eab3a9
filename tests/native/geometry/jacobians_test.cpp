// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/jacobians.h"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "native/gradient_check.h"
#include "native/support.h"

namespace supple {
namespace {

// A map v -> v B of one face has rows of edges times B, and the unit normal along n adj(B)^T.
Matrix3 expected_jacobian(const Matrix3& linear, const Eigen::RowVector3d& normal) {
  const Matrix3 cofactor = linear.determinant() * linear.inverse().transpose();
  const Matrix3 tangent = Matrix3::Identity() - normal.transpose() * normal;
  const Eigen::RowVector3d moved_normal = (normal * cofactor).normalized();
  return tangent * linear + normal.transpose() * moved_normal;
}

TEST(Jacobians, OfALinearMapInClosedForm) {
  const zoo::Mesh mesh = zoo::perturbed_sphere(1, 4);
  const MatrixField frames = face_frames(mesh.vertices, mesh.faces);
  const MatrixField inverses = inverse_frames(frames);
  for (uint64_t seed = 0; seed < 4; ++seed) {
    const Matrix3 linear = test::rotation(seed) + 0.3 * Matrix3(test::noise(3, 3, seed));
    const MatrixField field = jacobians(inverses, mesh.vertices * linear, mesh.faces);
    for (Eigen::Index f = 0; f < field.rows(); ++f) {
      const Matrix3 expected = expected_jacobian(linear, matrix_at(frames, f).row(2));
      EXPECT_LT((matrix_at(field, f) - expected).norm(), 1e-12) << "face " << f;
    }
  }
}

TEST(Jacobians, OfARotationAreThatRotation) {
  const zoo::Mesh mesh = zoo::torus(12, 6);
  const MatrixField inverses = inverse_frames(face_frames(mesh.vertices, mesh.faces));
  const Matrix3 turn = test::rotation(1);
  const MatrixField field = jacobians(inverses, mesh.vertices * turn, mesh.faces);
  for (Eigen::Index f = 0; f < field.rows(); ++f) {
    EXPECT_LT((matrix_at(field, f) - turn).norm(), 1e-13) << "face " << f;
  }
}

TEST(Jacobians, ConventionIsMovedFramesEqualRestFramesTimesJ) {
  const zoo::Mesh mesh = zoo::perturbed_sphere(1, 4);
  const Points target = test::bent(mesh.vertices);
  const MatrixField rest = face_frames(mesh.vertices, mesh.faces);
  const MatrixField posed = face_frames(target, mesh.faces);
  const MatrixField field = jacobians(inverse_frames(rest), target, mesh.faces);
  for (Eigen::Index f = 0; f < field.rows(); ++f) {
    EXPECT_LT((matrix_at(rest, f) * matrix_at(field, f) - matrix_at(posed, f)).norm(), 1e-13);
  }
}

TEST(Jacobians, FramesHaveUnitNormalsAndEdgesAsRows) {
  const zoo::Mesh mesh = zoo::perturbed_sphere(1, 9);
  const MatrixField frames = face_frames(mesh.vertices, mesh.faces);
  for (Eigen::Index f = 0; f < frames.rows(); ++f) {
    const auto frame = matrix_at(frames, f);
    const auto corner = [&](int c) { return mesh.vertices.row(mesh.faces(f, c)); };
    EXPECT_EQ(frame.row(0), corner(1) - corner(0));
    EXPECT_EQ(frame.row(1), corner(2) - corner(0));
    EXPECT_NEAR(frame.row(2).norm(), 1.0, 1e-15);
    EXPECT_NEAR(frame.row(2).dot(frame.row(0)), 0.0, 1e-15);
    EXPECT_GT(frame.determinant(), 0.0);
  }
}

TEST(Jacobians, AFaceWithoutAreaHasAZeroNormal) {
  Points vertices(3, 3);
  vertices << 0, 0, 0, 1, 0, 0, 2, 0, 0;
  const Faces faces = (Faces(1, 3) << 0, 1, 2).finished();
  EXPECT_TRUE(matrix_at(face_frames(vertices, faces), 0).row(2).isZero(0.0));
}

TEST(Jacobians, BackwardAgainstFiniteDifferences) {
  const zoo::Mesh mesh = zoo::perturbed_sphere(0, 4);
  const MatrixField inverses = inverse_frames(face_frames(mesh.vertices, mesh.faces));
  Points target = test::bent(mesh.vertices);
  MatrixField weights(mesh.faces.rows(), 9);
  weights = test::noise(weights.rows(), 9, 5);
  const auto value = [&] {
    return jacobians(inverses, target, mesh.faces).cwiseProduct(weights).sum();
  };
  const Points analytic = jacobians_backward(inverses, target, mesh.faces, weights);
  EXPECT_TRUE(test::gradient_matches(value, test::values_of(target), test::values_of(analytic)));
}

TEST(Jacobians, BackwardWithANormalThatMatters) {
  // Only the normal row weighs: the gradient is that of the turning normal alone.
  const zoo::Mesh mesh = zoo::perturbed_sphere(0, 4);
  const MatrixField frames = face_frames(mesh.vertices, mesh.faces);
  const MatrixField inverses = inverse_frames(frames);
  Points target = test::bent(mesh.vertices);
  MatrixField weights(mesh.faces.rows(), 9);
  const RowMatrix<double> random = test::noise(mesh.faces.rows(), 3, 6);
  for (Eigen::Index f = 0; f < weights.rows(); ++f) {
    matrix_at(weights, f) = matrix_at(frames, f).row(2).transpose() * random.row(f);
  }
  const auto value = [&] {
    return jacobians(inverses, target, mesh.faces).cwiseProduct(weights).sum();
  };
  const Points analytic = jacobians_backward(inverses, target, mesh.faces, weights);
  EXPECT_GT(analytic.norm(), 0.1);
  EXPECT_TRUE(test::gradient_matches(value, test::values_of(target), test::values_of(analytic)));
}

}  // namespace
}  // namespace supple
