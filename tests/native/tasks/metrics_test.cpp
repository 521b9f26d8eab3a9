// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/tasks/metrics.h"

#include <cmath>

#include "native/support.h"

namespace supple {
namespace {

Points scaled(const Points& points, double x, double y, double z) {
  return points * Eigen::RowVector3d(x, y, z).asDiagonal();
}

class MetricsZoo : public ::testing::TestWithParam<zoo::Entry> {};

TEST_P(MetricsZoo, ARigidMotionHasNoDistortion) {
  const zoo::Mesh& mesh = GetParam().mesh;
  const double size = test::diagonal(mesh.vertices);
  const Points posed =
      (mesh.vertices * test::rotation(1)).rowwise() + size * Eigen::RowVector3d(1, -2, 0.5);
  EXPECT_LT(face_distortion(mesh.vertices, mesh.faces, posed).maxCoeff(), 1e-9);
  EXPECT_LT(std::abs(symmetric_dirichlet(mesh.vertices, mesh.faces, posed)), 1e-9);
  EXPECT_EQ(flipped_faces(mesh.vertices, mesh.faces, posed), 0);
  EXPECT_EQ(flipped_faces(mesh.vertices, mesh.faces, mesh.vertices), 0);
  EXPECT_NEAR(pose_error(mesh.vertices, mesh.faces, posed, posed), 0.0, 1e-12);
}

TEST_P(MetricsZoo, TwiceTheSizeIsFourAndAHalfEverywhere) {
  // s = (2, 2): 4 + 4 + 1/4 + 1/4 - 4.
  const zoo::Mesh& mesh = GetParam().mesh;
  EXPECT_NEAR(symmetric_dirichlet(mesh.vertices, mesh.faces, 2.0 * mesh.vertices), 4.5, 1e-9);
}

SUPPLE_OVER_THE_ZOO(MetricsZoo);

TEST(FaceDistortion, StretchByTwoInOneDirection) {
  // s = (2, 1): 4 + 1 + 1/4 + 1 - 4.
  const zoo::Mesh mesh = zoo::grid(4, 3, 0.5);
  const Points posed = scaled(mesh.vertices, 2, 1, 1);
  EXPECT_LT((face_distortion(mesh.vertices, mesh.faces, posed).array() - 2.25).abs().maxCoeff(),
            1e-13);
  EXPECT_NEAR(symmetric_dirichlet(mesh.vertices, mesh.faces, posed), 2.25, 1e-13);
}

TEST(FaceDistortion, ShearByHand) {
  // [[1, 1], [0, 1]]: |J|^2 = |J^-1|^2 = 3.
  const zoo::Mesh mesh = zoo::grid(2, 2, 1.0);
  Points posed = mesh.vertices;
  posed.col(0) += posed.col(1);
  EXPECT_NEAR(symmetric_dirichlet(mesh.vertices, mesh.faces, posed), 2.0, 1e-13);
}

TEST(FaceDistortion, HasItsFloorAtOneMillionth) {
  const zoo::Mesh mesh = zoo::grid(1, 1, 1.0);
  const Points posed = scaled(mesh.vertices, 1, 0, 1);
  EXPECT_NEAR(face_distortion(mesh.vertices, mesh.faces, posed)[0], 1e12 - 2.0, 1e-2);
}

TEST(FaceDistortion, IsZeroWithoutRestArea) {
  zoo::Mesh mesh = zoo::grid(1, 1, 1.0);
  mesh.faces.conservativeResize(3, 3);
  mesh.faces.row(2) << 0, 1, 1;
  const Eigen::VectorXd got =
      face_distortion(mesh.vertices, mesh.faces, scaled(mesh.vertices, 2, 1, 1));
  EXPECT_EQ(got[2], 0.0);
  EXPECT_NEAR(got[0], 2.25, 1e-14);
}

TEST(SymmetricDirichlet, WeighsByRestArea) {
  // A unit square that is stretched and, three times as wide, one that is not.
  zoo::Mesh mesh = zoo::joined(zoo::grid(1, 1, 1.0), zoo::moved(zoo::grid(3, 1, 1.0), {5, 0, 0}));
  Points posed = mesh.vertices;
  posed.topRows<4>().col(0) *= 2.0;
  EXPECT_NEAR(symmetric_dirichlet(mesh.vertices, mesh.faces, posed), 2.25 / 4.0, 1e-13);
}

TEST(FlippedFaces, OneFaceFoldedOver) {
  // The middle vertex of a flat disc dragged across its ring turns some faces over.
  const zoo::Mesh mesh = zoo::disc(3, 12);
  EXPECT_EQ(flipped_faces(mesh.vertices, mesh.faces, mesh.vertices), 0);
  Points posed = mesh.vertices;
  // Corner 0 of the face (0, 1, 2) goes over the edge 1-2: that one face turns.
  const Eigen::RowVector3d middle = 0.5 * (posed.row(1) + posed.row(2));
  posed.row(0) = 1.05 * middle;
  EXPECT_EQ(flipped_faces(mesh.vertices, mesh.faces, posed), 1);
}

TEST(FlippedFaces, ACollapsedFaceCounts) {
  const zoo::Mesh mesh = zoo::grid(3, 3, 1.0);
  Points posed = mesh.vertices;
  posed.row(0) = 0.5 * (posed.row(1) + posed.row(5));
  // Faces (0, 1, 5) and (0, 5, 4): the first has no area left, the second lies as before.
  EXPECT_EQ(flipped_faces(mesh.vertices, mesh.faces, posed), 1);
}

TEST(FlippedFaces, FoldsThatWereThereAtRestDoNotCount) {
  const zoo::Mesh mesh = zoo::disc(3, 12);
  Points folded = mesh.vertices;
  folded.row(0) = 1.05 * 0.5 * (folded.row(1) + folded.row(2));
  EXPECT_EQ(flipped_faces(folded, mesh.faces, folded), 0);
}

TEST(PoseError, AShiftByHand) {
  // Every vertex is 0.5 off, on an area of 4: 100 * 0.5 / 2.
  const zoo::Mesh mesh = zoo::grid(2, 2, 1.0);
  const Points posed = mesh.vertices.rowwise() + Eigen::RowVector3d(0, 0.3, 0.4);
  EXPECT_NEAR(pose_error(mesh.vertices, mesh.faces, posed, mesh.vertices), 25.0, 1e-12);
}

TEST(PoseError, OneVertexCountsAThirdOfItsFaces) {
  // A corner of the unit square with one of its two faces: mass 1/6 of 1.
  const zoo::Mesh mesh = zoo::grid(1, 1, 1.0);
  Points posed = mesh.vertices;
  posed(1, 2) = 0.6;
  EXPECT_NEAR(pose_error(mesh.vertices, mesh.faces, posed, mesh.vertices),
              100.0 * 0.6 * std::sqrt(1.0 / 6.0), 1e-12);
}

TEST(Metrics, WrongShape) {
  const zoo::Mesh mesh = zoo::cube();
  const Points other = Points::Zero(7, 3);
  const auto expect = [](const std::function<void()>& call) {
    EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"8", "7"}, call));
  };
  expect([&] { face_distortion(mesh.vertices, mesh.faces, other); });
  expect([&] { symmetric_dirichlet(mesh.vertices, mesh.faces, other); });
  expect([&] { flipped_faces(mesh.vertices, mesh.faces, other); });
  expect([&] { pose_error(mesh.vertices, mesh.faces, mesh.vertices, other); });
}

}  // namespace
}  // namespace supple
