// SPDX-License-Identifier: GPL-3.0-or-later
// Rounds of an edit, faces eight by eight, against the same formulas face by face in double
// precision.
#include "tasks/edit/rounds.h"

#include <Eigen/LU>

#include "native/support.h"
#include "supple/geometry/jacobians.h"
#include "supple/geometry/rotations.h"

namespace supple {
namespace {

// Faces that do not fill the last block, several components and a boundary.
SurfaceOperators surface() {
  const zoo::Mesh mesh = zoo::joined(zoo::perturbed_sphere(1, 3), zoo::disc(3, 7));
  return SurfaceOperators(TriangleMesh(mesh.vertices, mesh.faces));
}

// Some pose's Jacobians: far from rotations, right way round.
MatrixField stretches(Eigen::Index faces) {
  MatrixField field = test::noise(faces, 9, 5);
  for (Eigen::Index f = 0; f < faces; ++f) {
    matrix_at(field, f) = Matrix3::Identity() + 0.2 * Matrix3(matrix_at(field, f));
  }
  return field;
}

Matrix3 start_at(const MatrixField* start, Eigen::Index f) {
  return start == nullptr ? Matrix3(Matrix3::Identity()) : Matrix3(matrix_at(*start, f));
}

class Rounds : public ::testing::Test {
 protected:
  Rounds()
      : operators(surface()),
        faces(operators),
        moved(test::bent(operators.vertices)),
        jacobians(operators.jacobians_of(moved)),
        pose(stretches(operators.faces.rows())),
        pose_blocks(in_blocks(pose)) {}

  Matrix3 rotation_at(const MatrixField* start, Eigen::Index f) const {
    return closest_rotation(start_at(start, f).transpose() * matrix_at(jacobians, f));
  }
  // grad^T A (T - J)
  template <class Target>
  Points expected(const Target& target) const {
    MatrixField away(jacobians.rows(), 9);
    for (Eigen::Index f = 0; f < away.rows(); ++f) {
      matrix_at(away, f) = target(f) - matrix_at(jacobians, f);
    }
    return operators.divergence_of(away);
  }
  // from rest, and from the pose
  template <class Check>
  void from_both(const Check& check) const {
    test::at_every_simd_level([&] {
      check(nullptr, nullptr);
      check(&pose, &pose_blocks);
    });
  }
  static void expect_near(const Points& got, const Points& wanted) {
    EXPECT_LT((got - wanted).cwiseAbs().maxCoeff(), 3e-6 * wanted.cwiseAbs().maxCoeff());
  }

  SurfaceOperators operators;
  FaceBlocks faces;
  Points moved;
  MatrixField jacobians, pose;
  BlockField pose_blocks;
};

// By angles from nearly none to many turns.
TEST_F(Rounds, TowardsTurns) {
  const Matrix3 whole = test::rotation(4);
  RowMatrix<double> vectors = test::noise(moved.rows(), 3, 9);
  vectors.topRows(vectors.rows() / 2) *= 3.0;
  vectors.topRows(20) *= 1e-7;
  vectors.bottomRows(40).rowwise() = Eigen::RowVector3d(0.0, 6.0, 1.0);
  vectors.bottomRows(20).rowwise() = Eigen::RowVector3d(20.0, -30.0, 17.0);
  vectors.bottomRows(10) *= 6.0;
  from_both([&](const MatrixField* start, const BlockField* blocks) {
    expect_near(towards_turned(faces, moved, vectors, whole, blocks),
                expected([&](Eigen::Index f) -> Matrix3 {
                  const auto face = operators.faces.row(f);
                  const Eigen::RowVector3d mean =
                      (vectors.row(face[0]) + vectors.row(face[1]) + vectors.row(face[2])) / 3.0;
                  return start_at(start, f) * whole * rotation_matrix(mean);
                }));
  });
}

TEST_F(Rounds, TowardsClosestRotations) {
  from_both([&](const MatrixField* start, const BlockField* blocks) {
    expect_near(towards_rotations(faces, moved, blocks), expected([&](Eigen::Index f) -> Matrix3 {
                  return start_at(start, f) * rotation_at(start, f);
                }));
    const MatrixField found = rotations_of(faces, moved, blocks);
    for (Eigen::Index f = 0; f < found.rows(); ++f) {
      EXPECT_LT((matrix_at(found, f) - rotation_at(start, f)).norm(), 2e-6) << "face " << f;
    }
  });
}

TEST_F(Rounds, TowardsBoundedStretches) {
  constexpr double kShare = 0.7, kMost = 0.3;
  MatrixField predicted = stretches(jacobians.rows());
  predicted.row(11) *= -1.0;  // mirrored
  Eigen::Index bounded = 0;
  for (Eigen::Index f = 0; f < predicted.rows(); ++f) {
    const Matrix3 stretch = polar_decomposition(matrix_at(predicted, f)).stretch;
    bounded += (stretch - Matrix3::Identity()).norm() > kMost ? 1 : 0;
  }
  EXPECT_GT(bounded, 0);
  EXPECT_LT(bounded, predicted.rows());
  from_both([&](const MatrixField* start, const BlockField* blocks) {
    BlockField stretch;
    MatrixField kept(predicted.rows(), 9);
    expect_near(towards_bounded(faces, moved, predicted, kShare, kMost, blocks, stretch),
                expected([&](Eigen::Index f) -> Matrix3 {
                  const PolarDecomposition polar = polar_decomposition(matrix_at(predicted, f));
                  const Matrix3 away = polar.stretch - Matrix3::Identity();
                  const Matrix3 left =
                      Matrix3::Identity() + kShare * std::min(1.0, kMost / away.norm()) * away;
                  matrix_at(kept, f) = start_at(start, f) * left;
                  return start_at(start, f) * left * polar.rotation;
                }));
    const BlockField expected_stretch = in_blocks(kept);
    ASSERT_EQ(stretch.size(), expected_stretch.size());
    for (Eigen::Index f = 0; f < kept.rows(); ++f) {
      for (int e = 0; e < 9; ++e) {
        EXPECT_NEAR(stretch[static_cast<size_t>(f / kBlock)].e[e][f % kBlock], kept(f, e), 2e-6);
      }
    }
  });
}

// Also where rounding says otherwise: a rigid motion leaves nothing to do.
TEST_F(Rounds, NothingIsLeftOfARigidMotion) {
  const Points turned =
      (operators.vertices * test::rotation(3)).rowwise() + Eigen::RowVector3d(3.0, -1.0, 2.0);
  test::at_every_simd_level(
      [&] { EXPECT_EQ(towards_rotations(faces, turned, nullptr).cwiseAbs().maxCoeff(), 0.0); });
}

// Faces without an area have no normal, and several rotations are as close.
TEST_F(Rounds, CollapsedFacesHaveARotation) {
  Points flat = operators.vertices;
  flat.col(2).setZero();
  for (int c = 0; c < 3; ++c) {
    flat.row(operators.faces(9, c)) = flat.row(operators.faces(9, 0));
  }
  const MatrixField j = operators.jacobians_of(flat);
  test::at_every_simd_level([&] {
    const MatrixField found = rotations_of(faces, flat, nullptr);
    for (Eigen::Index f = 0; f < found.rows(); ++f) {
      const Matrix3 q = matrix_at(found, f);
      EXPECT_LT((q.transpose() * q - Matrix3::Identity()).norm(), 1e-5) << "face " << f;
      EXPECT_NEAR(q.determinant(), 1.0, 1e-5) << "face " << f;
      const Matrix3 best = closest_rotation(matrix_at(j, f));
      EXPECT_NEAR(q.cwiseProduct(Matrix3(matrix_at(j, f))).sum(),
                  best.cwiseProduct(Matrix3(matrix_at(j, f))).sum(), 1e-4)
          << "face " << f;
    }
  });
}

}  // namespace
}  // namespace supple
