// SPDX-License-Identifier: GPL-3.0-or-later
#include "native/support.h"
#include "supple/geometry/operators.h"
#include "supple/geometry/surface_operators.h"

namespace supple {
namespace {

class AveragingZoo : public ::testing::TestWithParam<zoo::Entry> {};

TEST_P(AveragingZoo, RowsSumToOne) {
  const TriangleMesh mesh(GetParam().mesh.vertices, GetParam().mesh.faces);
  const SurfaceOperators operators(mesh);
  for (const auto weights : {AveragingWeights::uniform, AveragingWeights::area}) {
    const SparseRowMatrix average = average_faces_to_vertices(
        operators.faces, operators.vertices.rows(), weights, operators.face_areas);
    const Eigen::VectorXd sums = average * Eigen::VectorXd::Ones(operators.faces.rows());
    EXPECT_LT((sums.array() - 1.0).abs().maxCoeff(), 1e-14);
  }
  EXPECT_EQ(
      Eigen::MatrixXd(operators.average),
      Eigen::MatrixXd(average_faces_to_vertices(operators.faces, operators.vertices.rows(),
                                                AveragingWeights::uniform, operators.face_areas)));
}

TEST_P(AveragingZoo, BackwardIsTheTranspose) {
  const TriangleMesh mesh(GetParam().mesh.vertices, GetParam().mesh.faces);
  const Faces& faces = mesh.surface_faces();
  const Eigen::Index n = mesh.surface_vertices().rows();
  const RowMatrix<double> x = test::noise(n, 4, 1), y = test::noise(faces.rows(), 4, 2);
  const double forward = average_vertices_to_faces(faces, x).cwiseProduct(y).sum();
  const double backward = x.cwiseProduct(average_vertices_to_faces_backward(faces, n, y)).sum();
  EXPECT_NEAR(forward, backward, 1e-12 * std::max(1.0, std::abs(forward)));
}

SUPPLE_OVER_THE_ZOO(AveragingZoo);

// Two triangles of areas 1 and 3 that share the edge 0-1.
const Faces kFaces = (Faces(2, 3) << 0, 1, 2, 1, 0, 3).finished();
const Eigen::Vector2d kAreas(1.0, 3.0);

TEST(Averaging, UniformWeightsByHand) {
  const Eigen::MatrixXd average =
      average_faces_to_vertices(kFaces, 4, AveragingWeights::uniform, kAreas);
  const Eigen::MatrixXd expected =
      (Eigen::MatrixXd(4, 2) << 0.5, 0.5, 0.5, 0.5, 1, 0, 0, 1).finished();
  EXPECT_EQ(average, expected);
}

TEST(Averaging, AreaWeightsByHand) {
  const Eigen::MatrixXd average =
      average_faces_to_vertices(kFaces, 4, AveragingWeights::area, kAreas);
  const Eigen::MatrixXd expected =
      (Eigen::MatrixXd(4, 2) << 0.25, 0.75, 0.25, 0.75, 1, 0, 0, 1).finished();
  EXPECT_EQ(average, expected);
}

TEST(Averaging, VerticesToFacesIsTheMeanOfTheCorners) {
  const RowMatrix<double> field =
      (RowMatrix<double>(4, 2) << 0, 10, 3, 20, 6, 30, 9, 60).finished();
  const RowMatrix<double> expected = (RowMatrix<double>(2, 2) << 3, 20, 4, 30).finished();
  EXPECT_TRUE(average_vertices_to_faces(kFaces, field).isApprox(expected, 1e-15));
}

}  // namespace
}  // namespace supple
