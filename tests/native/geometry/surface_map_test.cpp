// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/surface_map.h"

#include "native/support.h"

namespace supple {
namespace {

using test::fails_with;

Points corner_weights() {
  Points weights(3, 3);
  weights << 1, 0, 0, 0.25, 0.25, 0.5, 0, 0, 0;
  return weights;
}

TEST(SurfaceMap, AVertexIsACornerOfItsLowestFace) {
  Faces faces(4, 3);
  faces << 2, 2, 3, 0, 1, 2, 2, 3, 1, 5, 5, 0;
  const Eigen::VectorXi wanted = (Eigen::VectorXi(7) << 2, 3, 4, -1, 5, 0, 1).finished();
  const SurfaceMap map = surface_map(wanted, faces, 6);
  // 2 and 3 have a face with three corners; 5 has none but the last; 4 is unused.
  EXPECT_EQ(map.face, (Eigen::VectorXi(7) << 1, 2, -1, -1, 3, 1, 1).finished());
  check_surface_map(map, 7, faces);
  EXPECT_EQ(nearest_corners(map, faces), (Eigen::VectorXi(7) << 2, 3, -1, -1, 5, 0, 1).finished());
  EXPECT_TRUE(fails_with(ErrorCode::index_out_of_range, {"point 1", "vertex 9", "6 vertices"},
                         [&] { surface_map(Eigen::Vector2i(0, 9), faces, 6); }));
  EXPECT_TRUE(fails_with(ErrorCode::index_out_of_range, {"Face 3", "vertex 5"},
                         [&] { surface_map(wanted, faces, 5); }));
}

class EverySurfaceMap : public ::testing::TestWithParam<zoo::Entry> {};
SUPPLE_OVER_THE_ZOO(EverySurfaceMap);

TEST_P(EverySurfaceMap, OfAPointMapGivesItBack) {
  const zoo::Mesh& mesh = GetParam().mesh;
  const Eigen::Index n = mesh.vertices.rows();
  std::vector<bool> used(n);
  for (const int v : mesh.faces.reshaped()) {
    used[v] = true;
  }
  Eigen::VectorXi wanted(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    wanted[i] = static_cast<int>((7 * i + 3) % n);
  }
  const Eigen::VectorXi back = nearest_corners(surface_map(wanted, mesh.faces, n), mesh.faces);
  for (Eigen::Index i = 0; i < n; ++i) {
    EXPECT_EQ(back[i], used[wanted[i]] ? wanted[i] : -1);
  }
}

TEST(SurfaceMap, AppliesInsideATriangle) {
  const Faces faces = (Faces(1, 3) << 3, 0, 1).finished();
  const SurfaceMap map{Eigen::Vector3i(0, 0, -1), corner_weights()};
  const RowMatrix<double> field =
      (RowMatrix<double>(4, 2) << 1, 10, 2, 20, 50, 60, 4, 40).finished();
  const RowMatrix<double> expected =
      (RowMatrix<double>(3, 2) << 4, 40, 2.25, 22.5, 7, 7).finished();
  EXPECT_LT((apply(map, faces, field, 7.0) - expected).norm(), 1e-14);
  EXPECT_EQ(nearest_corners(map, faces), Eigen::Vector3i(3, 1, -1));
  EXPECT_TRUE(fails_with(ErrorCode::index_out_of_range, {"Face 0", "vertex 3", "3 rows"},
                         [&] { apply(map, faces, RowMatrix<double>(field.topRows(3))); }));
}

TEST(SurfaceMap, AppliesLinearFunctionsExactly) {
  const zoo::Mesh mesh = zoo::icosphere(2);
  const Points queries = test::noise(200, 3, 5);
  const SurfaceMap map = ClosestSurfacePoints(mesh.vertices, mesh.faces).query(queries).map;
  const Points at = apply(map, mesh.faces, mesh.vertices);
  const Matrix3 linear = Matrix3::Random();
  const Points moved = mesh.vertices * linear;
  EXPECT_LT(test::farthest(apply(map, mesh.faces, moved), at * linear), 1e-12);
}

TEST(SurfaceMap, SaysWhatIsWrong) {
  const Faces faces = (Faces(1, 3) << 0, 1, 2).finished();
  const auto with = [&](int face, double weight) {
    SurfaceMap map{Eigen::Vector3i(0, 0, face), corner_weights()};
    map.weights(1, 0) = weight;
    return map;
  };
  EXPECT_NO_THROW(check_surface_map(with(-1, 0.25), 3, faces));
  EXPECT_TRUE(fails_with(ErrorCode::wrong_shape, {"3 faces", "4 source points"},
                         [&] { check_surface_map(with(-1, 0.25), 4, faces); }));
  EXPECT_TRUE(fails_with(ErrorCode::index_out_of_range, {"point 2", "face 1", "1 faces"},
                         [&] { check_surface_map(with(1, 0.25), 3, faces); }));
  EXPECT_TRUE(fails_with(ErrorCode::index_out_of_range, {"point 2", "face -2"},
                         [&] { check_surface_map(with(-2, 0.25), 3, faces); }));
  EXPECT_TRUE(fails_with(ErrorCode::bad_option, {"point 1", "sum"},
                         [&] { check_surface_map(with(-1, 0.3), 3, faces); }));
  EXPECT_TRUE(fails_with(ErrorCode::not_finite, {"point 1"}, [&] {
    check_surface_map(with(-1, std::numeric_limits<double>::quiet_NaN()), 3, faces);
  }));
  SurfaceMap negative = with(-1, 0.25);
  negative.weights.row(1) << 1.5, -0.5, 0.0;
  EXPECT_TRUE(fails_with(ErrorCode::bad_option, {"point 1", "below 0"},
                         [&] { check_surface_map(negative, 3, faces); }));
}

}  // namespace
}  // namespace supple
