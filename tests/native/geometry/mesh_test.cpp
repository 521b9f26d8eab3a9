// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/mesh.h"

#include <limits>
#include <map>

#include "native/support.h"

namespace supple {
namespace {

using test::fails_with;

std::map<std::string, int> counts(const TriangleMesh& mesh) {
  std::map<std::string, int> result;
  for (const Note& note : mesh.notes()) {
    EXPECT_FALSE(note.message.empty()) << note.code;
    EXPECT_TRUE(result.emplace(note.code, note.count).second) << note.code << " twice";
  }
  return result;
}

class MeshZoo : public ::testing::TestWithParam<zoo::Entry> {};

TEST_P(MeshZoo, NotesNameWhatIsThere) {
  const zoo::Entry& entry = GetParam();
  const TriangleMesh mesh(entry.mesh.vertices, entry.mesh.faces);
  std::map<std::string, int> expected;
  const auto expect = [&](const char* code, int count, int from) {
    if (count >= from) {
      expected[code] = count;
    }
  };
  expect("degenerate_faces", entry.degenerate_faces, 1);
  expect("unattached_vertices", entry.unattached_vertices, 1);
  expect("boundary", entry.boundary_edges, 1);
  expect("nonmanifold_edges", entry.nonmanifold_edges, 1);
  expect("components", entry.components, 2);
  EXPECT_EQ(counts(mesh), expected);
  EXPECT_EQ(mesh.component_count(), entry.components);
}

TEST_P(MeshZoo, SurfaceHasUnitAreaAndCentroidZero) {
  const zoo::Entry& entry = GetParam();
  const TriangleMesh mesh(entry.mesh.vertices, entry.mesh.faces);
  EXPECT_NEAR(face_areas(mesh.surface_vertices(), mesh.surface_faces()).sum(), 1.0, 1e-12);
  EXPECT_LT(mesh.surface_vertices().colwise().mean().norm(), 1e-12);
}

TEST_P(MeshZoo, MapsBetweenMeshAndSurfaceAreInverse) {
  const zoo::Entry& entry = GetParam();
  const TriangleMesh mesh(entry.mesh.vertices, entry.mesh.faces);
  ASSERT_EQ(mesh.surface_vertex().size(), entry.mesh.vertices.rows());
  for (int i = 0; i < mesh.mesh_vertex().size(); ++i) {
    EXPECT_EQ(mesh.surface_vertex()[mesh.mesh_vertex()[i]], i);
  }
  EXPECT_EQ((mesh.surface_vertex().array() < 0).count(), entry.unattached_vertices);
  for (int f = 0; f < mesh.surface_faces().rows(); ++f) {
    for (int c = 0; c < 3; ++c) {
      EXPECT_EQ(mesh.mesh_vertex()[mesh.surface_faces()(f, c)],
                entry.mesh.faces(mesh.mesh_face()[f], c));
    }
  }
}

TEST_P(MeshZoo, UnitsGoThereAndBack) {
  const zoo::Entry& entry = GetParam();
  const TriangleMesh mesh(entry.mesh.vertices, entry.mesh.faces);
  const Points back = mesh.from_surface(mesh.to_surface(entry.mesh.vertices));
  EXPECT_LT(test::farthest(back, entry.mesh.vertices), 1e-11 * mesh.diagonal());
  EXPECT_NEAR(mesh.diagonal(), test::diagonal(entry.mesh.vertices), 1e-12 * mesh.diagonal());
}

TEST_P(MeshZoo, ScatterOfAnAffineMapMovesEveryVertex) {
  const zoo::Entry& entry = GetParam();
  const TriangleMesh mesh(entry.mesh.vertices, entry.mesh.faces);
  const Matrix3 linear = test::rotation(2) + 0.2 * Matrix3(test::noise(3, 3, 4));
  MatrixField field(mesh.surface_vertices().rows(), 9);
  field.rowwise() = Eigen::Map<const Eigen::Matrix<double, 1, 9>>(linear.data());
  const Points result = mesh.scatter(mesh.surface_vertices() * linear, field);
  const Points expected = mesh.from_surface(mesh.to_surface(entry.mesh.vertices) * linear);
  EXPECT_LT(test::farthest(result, expected), 1e-11 * mesh.diagonal());
}

SUPPLE_OVER_THE_ZOO(MeshZoo);

TEST(TriangleMesh, NoFaces) {
  EXPECT_TRUE(fails_with(ErrorCode::empty_mesh, {"no faces"},
                         [] { TriangleMesh(zoo::cube().vertices, Faces(0, 3)); }));
}

TEST(TriangleMesh, NothingAtAll) {
  EXPECT_TRUE(
      fails_with(ErrorCode::empty_mesh, {}, [] { TriangleMesh(Points(0, 3), Faces(0, 3)); }));
}

TEST(TriangleMesh, OnlyFacesWithoutArea) {
  Points vertices(3, 3);
  vertices << 0, 0, 0, 1, 0, 0, 2, 0, 0;
  Faces faces(2, 3);
  faces << 0, 1, 2, 0, 0, 1;
  EXPECT_TRUE(
      fails_with(ErrorCode::empty_mesh, {"2", "area"}, [&] { TriangleMesh(vertices, faces); }));
}

TEST(TriangleMesh, IndexOutOfRangeNamesTheFace) {
  zoo::Mesh mesh = zoo::cube();
  mesh.faces(5, 1) = 8;
  EXPECT_TRUE(fails_with(ErrorCode::index_out_of_range, {"Face 5", "vertex 8", "8 vertices"},
                         [&] { TriangleMesh(mesh.vertices, mesh.faces); }));
  mesh.faces(5, 1) = -1;
  EXPECT_TRUE(fails_with(ErrorCode::index_out_of_range, {"Face 5", "-1"},
                         [&] { TriangleMesh(mesh.vertices, mesh.faces); }));
}

TEST(TriangleMesh, NotFiniteNamesTheVertex) {
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
        -std::numeric_limits<double>::infinity()}) {
    zoo::Mesh mesh = zoo::cube();
    mesh.vertices(3, 2) = bad;
    EXPECT_TRUE(fails_with(ErrorCode::not_finite, {"Vertex 3"},
                           [&] { TriangleMesh(mesh.vertices, mesh.faces); }));
  }
}

TEST(TriangleMesh, NotFiniteInAnUnusedVertex) {
  zoo::Mesh mesh = zoo::with_unused_vertices(zoo::cube());
  mesh.vertices(0, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(fails_with(ErrorCode::not_finite, {"Vertex 0"},
                         [&] { TriangleMesh(mesh.vertices, mesh.faces); }));
}

TEST(TriangleMesh, ComponentsAreLabelledTogether) {
  const zoo::Mesh mesh = zoo::two_spheres(0);
  const TriangleMesh checked(mesh.vertices, mesh.faces);
  const Eigen::VectorXi& label = checked.component();
  EXPECT_TRUE((label.head(12).array() == label[0]).all());
  EXPECT_TRUE((label.tail(12).array() == label[12]).all());
  EXPECT_NE(label[0], label[12]);
}

TEST(TriangleMesh, AreasAndNormalsOfAKnownTriangle) {
  Points vertices(3, 3);
  vertices << 1, 1, 5, 4, 1, 5, 1, 5, 5;
  const Faces faces = (Faces(1, 3) << 0, 1, 2).finished();
  EXPECT_DOUBLE_EQ(face_areas(vertices, faces)[0], 6.0);
  EXPECT_TRUE(face_normals(vertices, faces).row(0).isApprox(Eigen::RowVector3d(0, 0, 1), 1e-15));
}

}  // namespace
}  // namespace supple
