// SPDX-License-Identifier: GPL-3.0-or-later
// The zoo is what it claims to be; a test over it proves nothing otherwise.
#include "native/zoo.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <iterator>
#include <map>
#include <utility>
#include <vector>

#include "native/support.h"

namespace supple {
namespace {

std::map<std::pair<int, int>, int> directed_edges(const Faces& faces) {
  std::map<std::pair<int, int>, int> count;
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    for (int c = 0; c < 3; ++c) {
      ++count[{faces(f, c), faces(f, (c + 1) % 3)}];
    }
  }
  return count;
}

double volume(const zoo::Mesh& mesh) {
  double six = 0.0;
  for (Eigen::Index f = 0; f < mesh.faces.rows(); ++f) {
    const Eigen::RowVector3d a = mesh.vertices.row(mesh.faces(f, 0));
    const Eigen::RowVector3d b = mesh.vertices.row(mesh.faces(f, 1));
    const Eigen::RowVector3d c = mesh.vertices.row(mesh.faces(f, 2));
    six += a.dot(b.cross(c));
  }
  return six / 6.0;
}

std::vector<zoo::Entry> closed() {
  std::vector<zoo::Entry> result;
  std::copy_if(zoo::all().begin(), zoo::all().end(), std::back_inserter(result),
               [](const auto& e) { return e.boundary_edges == 0 && e.degenerate_faces == 0; });
  return result;
}

class ClosedZoo : public ::testing::TestWithParam<zoo::Entry> {};

TEST_P(ClosedZoo, IsOrientedOutwards) {
  const zoo::Mesh& mesh = GetParam().mesh;
  const auto edges = directed_edges(mesh.faces);
  for (const auto& [edge, count] : edges) {
    EXPECT_EQ(count, 1) << "edge " << edge.first << " " << edge.second;
    EXPECT_EQ(edges.count({edge.second, edge.first}), 1U);
  }
  EXPECT_GT(volume(mesh), 0.0);
}

INSTANTIATE_TEST_SUITE_P(Zoo, ClosedZoo, ::testing::ValuesIn(closed()), test::entry_name);

class AnyZoo : public ::testing::TestWithParam<zoo::Entry> {};

TEST_P(AnyZoo, IndicesAreInRange) {
  EXPECT_GE(GetParam().mesh.faces.minCoeff(), 0);
  EXPECT_LT(GetParam().mesh.faces.maxCoeff(), GetParam().mesh.vertices.rows());
}

SUPPLE_OVER_THE_ZOO(AnyZoo);

TEST(ZooShapes, IcosphereIsTheUnitSphere) {
  const zoo::Mesh mesh = zoo::icosphere(3);
  EXPECT_EQ(mesh.vertices.rows(), 642);
  EXPECT_EQ(mesh.faces.rows(), 1280);
  EXPECT_LT((mesh.vertices.rowwise().norm().array() - 1.0).abs().maxCoeff(), 1e-14);
}

TEST(ZooShapes, SquareTowerHasFourfoldSymmetry) {
  const zoo::Mesh mesh = zoo::square_tower(2, 6);
  Points turned(mesh.vertices.rows(), 3);
  turned << -mesh.vertices.col(1), mesh.vertices.col(0), mesh.vertices.col(2);
  for (Eigen::Index i = 0; i < turned.rows(); ++i) {
    const Eigen::RowVector3d p = turned.row(i);
    EXPECT_EQ((mesh.vertices.rowwise() - p).rowwise().norm().minCoeff(), 0.0) << "vertex " << i;
  }
}

TEST(ZooShapes, SliversAreAsThinAsAsked) {
  const zoo::Mesh mesh = zoo::with_slivers(zoo::icosphere(1), 1e-4);
  const Eigen::RowVector3d a = mesh.vertices.row(mesh.faces(0, 0));
  const Eigen::RowVector3d b = mesh.vertices.row(mesh.faces(0, 1));
  const Eigen::RowVector3d p = mesh.vertices.row(mesh.faces(0, 2));
  EXPECT_NEAR((b - a).cross(p - a).norm() / (b - a).squaredNorm(), 1e-4, 1e-9);
}

}  // namespace
}  // namespace supple
