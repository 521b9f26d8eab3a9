// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "native/support.h"
#include "supple/geometry/mesh.h"
#include "supple/geometry/surface_map.h"

namespace supple {
namespace {

using test::fails_with;
using Result = ClosestSurfacePoints::Result;

// Of a triangle by another way than the library's: a quadratic over the inside, then each edge.
double squared_distance(const Points& v, const Faces& faces, Eigen::Index f,
                        const Eigen::RowVector3d& p) {
  const Eigen::RowVector3d a = v.row(faces(f, 0));
  Eigen::Matrix<double, 3, 2> edges;
  edges.col(0) = (v.row(faces(f, 1)) - a).transpose();
  edges.col(1) = (v.row(faces(f, 2)) - a).transpose();
  const Eigen::Vector2d inside = edges.colPivHouseholderQr().solve((p - a).transpose());
  double best = std::numeric_limits<double>::infinity();
  if (inside.minCoeff() >= 0.0 && inside.sum() <= 1.0) {
    best = (edges * inside - (p - a).transpose()).squaredNorm();
  }
  for (int e = 0; e < 3; ++e) {
    const Eigen::RowVector3d from = v.row(faces(f, e));
    const Eigen::RowVector3d along = v.row(faces(f, (e + 1) % 3)) - from;
    const double t = std::clamp((p - from).dot(along) / along.squaredNorm(), 0.0, 1.0);
    best = std::min(best, (from + t * along - p).squaredNorm());
  }
  return best;
}

// Vertices (ties among all their faces), points in faces, near ones and far ones.
Points queries_for(const zoo::Mesh& mesh) {
  const TriangleMesh checked(mesh.vertices, mesh.faces);
  const double size = checked.diagonal();
  const Points surface = checked.from_surface(checked.surface_vertices());
  const Eigen::Index n = std::min<Eigen::Index>(surface.rows(), 60);
  Points queries(4 * n, 3);
  queries << surface.topRows(n), surface.topRows(n) + 0.01 * size * Points(test::noise(n, 3, 1)),
      surface.topRows(n) + 0.3 * size * Points(test::noise(n, 3, 2)),
      3.0 * size * Points(test::noise(n, 3, 3));
  return queries;
}

class EverySurface : public ::testing::TestWithParam<zoo::Entry> {};
SUPPLE_OVER_THE_ZOO(EverySurface);

TEST_P(EverySurface, TheNearestPointIsThatOfTryingAllFaces) {
  const zoo::Mesh& mesh = GetParam().mesh;
  const Points queries = queries_for(mesh);
  const double size = test::diagonal(mesh.vertices);
  const Result result = ClosestSurfacePoints(mesh.vertices, mesh.faces).query(queries);
  check_surface_map(result.map, queries.rows(), mesh.faces);
  EXPECT_EQ(result.agrees.size(), 0);
  const Points at = apply(result.map, mesh.faces, mesh.vertices);
  for (Eigen::Index i = 0; i < queries.rows(); ++i) {
    double least = std::numeric_limits<double>::infinity();
    for (Eigen::Index f = 0; f < mesh.faces.rows(); ++f) {
      if (!is_degenerate(mesh.vertices, mesh.faces, f)) {
        least = std::min(least, squared_distance(mesh.vertices, mesh.faces, f, queries.row(i)));
      }
    }
    const double distance = (at.row(i) - queries.row(i)).norm();
    EXPECT_NEAR(distance, std::sqrt(least), 1e-9 * size) << i;
    EXPECT_NEAR(std::sqrt(result.squared_distance[i]), std::sqrt(least), 1e-9 * size) << i;
  }
}

TEST_P(EverySurface, ASurfacePointsTieGoesToTheLowestFace) {
  const zoo::Mesh& mesh = GetParam().mesh;
  const ClosestSurfacePoints closest(mesh.vertices, mesh.faces);
  const Result result = closest.query(mesh.vertices);
  for (Eigen::Index v = 0; v < mesh.vertices.rows(); ++v) {
    for (Eigen::Index f = 0; f < mesh.faces.rows(); ++f) {
      if ((mesh.faces.row(f).array() == static_cast<int>(v)).any() &&
          !is_degenerate(mesh.vertices, mesh.faces, f)) {
        EXPECT_LE(result.map.face[v], f);
        EXPECT_LT(result.squared_distance[v], 1e-18 * std::pow(test::diagonal(mesh.vertices), 2));
        break;
      }
    }
  }
}

TEST_P(EverySurface, MovesWithTheMesh) {
  const zoo::Mesh& mesh = GetParam().mesh;
  const Points queries = queries_for(mesh);
  const Matrix3 turn = test::rotation(3);
  const auto moved = [&](const Points& p) -> Points {
    return (70.0 * p * turn).rowwise() + Eigen::RowVector3d(5, -3, 2);
  };
  const Result here = ClosestSurfacePoints(mesh.vertices, mesh.faces).query(queries);
  const Result there = ClosestSurfacePoints(moved(mesh.vertices), mesh.faces).query(moved(queries));
  const double size = test::diagonal(mesh.vertices);
  EXPECT_LT((there.squared_distance.cwiseSqrt() / 70.0 - here.squared_distance.cwiseSqrt())
                .cwiseAbs()
                .maxCoeff(),
            1e-9 * size);
}

TEST(ClosestSurfacePoints, ThreadsChangeNothing) {
  const zoo::Mesh mesh = zoo::perturbed_sphere(3, 4);
  const ClosestSurfacePoints closest(mesh.vertices, mesh.faces);
  const Points queries = test::noise(3000, 3, 8);
  const auto with = [&](int threads) {
    const test::Threads scope(threads);
    return closest.query(queries);
  };
  const Result one = with(1), four = with(4);
  EXPECT_EQ(one.map.face, four.map.face);
  EXPECT_EQ(one.map.weights, four.map.weights);
  EXPECT_EQ(one.squared_distance, four.squared_distance);
}

TEST(ClosestSurfacePoints, NormalsChooseTheSideOfAThinPlate) {
  // Two sheets, 0.1 apart, facing away from each other.
  const zoo::Mesh up = zoo::grid(6, 6, 0.5);
  zoo::Mesh down = zoo::moved(up, {0, 0, -0.1});
  down.faces.col(0).swap(down.faces.col(1));
  const zoo::Mesh plate = zoo::joined(up, down);
  const Eigen::Index half = up.faces.rows();
  Points points = up.vertices;
  points.col(2).setConstant(-0.04);  // nearer to the upper sheet
  const Points upwards = Points::Zero(points.rows(), 3).rowwise() + Eigen::RowVector3d(0, 0, 1);
  const ClosestSurfacePoints closest(plate.vertices, plate.faces);

  const Result plain = closest.query(points);
  EXPECT_LT(plain.map.face.maxCoeff(), half);
  const Result same = closest.query(points, upwards, 0.5);
  EXPECT_EQ(same.map.face, plain.map.face);
  EXPECT_TRUE(same.agrees.all());
  const Result other = closest.query(points, -upwards, 0.5);
  EXPECT_GE(other.map.face.minCoeff(), half);
  EXPECT_TRUE(other.agrees.all());
  EXPECT_NEAR(other.squared_distance.minCoeff(), 0.06 * 0.06, 1e-12);
  EXPECT_NEAR(other.squared_distance.maxCoeff(), 0.06 * 0.06, 1e-12);
  // Out of reach, or nowhere at all: the nearest, and it says so.
  const Result near = closest.query(points, -upwards, 0.5, 0.05);
  EXPECT_EQ(near.map.face, plain.map.face);
  EXPECT_FALSE(near.agrees.any());
  const Points sideways = Points::Zero(points.rows(), 3).rowwise() + Eigen::RowVector3d(1, 0, 0);
  const Result nowhere = closest.query(points, sideways, 0.5);
  EXPECT_EQ(nowhere.map.face, plain.map.face);
  EXPECT_FALSE(nowhere.agrees.any());
}

TEST_P(EverySurface, FacesToStartFromChangeNothing) {
  const zoo::Mesh& mesh = GetParam().mesh;
  const Points queries = queries_for(mesh);
  const Points normals = Points(test::noise(queries.rows(), 3, 5)).rowwise().normalized();
  const ClosestSurfacePoints surface(mesh.vertices, mesh.faces);
  Eigen::VectorXi near(queries.rows());
  for (Eigen::Index i = 0; i < near.size(); ++i) {
    near[i] = static_cast<int>(7 * i % mesh.faces.rows());
  }
  const double reach = 0.3 * test::diagonal(mesh.vertices);
  const Result from_none = surface.query(queries, normals, 0.2, reach);
  const Result result = surface.query(queries, normals, 0.2, reach, near);
  EXPECT_EQ(result.map.face, from_none.map.face);
  EXPECT_EQ(result.squared_distance, from_none.squared_distance);
  EXPECT_TRUE((result.agrees == from_none.agrees).all());
}

TEST(ClosestSurfacePoints, FarFromTheOriginItIsAsExact) {
  zoo::Mesh mesh = zoo::perturbed_sphere(2, 3);
  const Points queries = queries_for(mesh);
  const Result here = ClosestSurfacePoints(mesh.vertices, mesh.faces).query(queries);
  const Eigen::RowVector3d away(4096.0, -8192.0, 1024.0);
  const Result there = ClosestSurfacePoints(mesh.vertices.rowwise() + away, mesh.faces)
                           .query(queries.rowwise() + away);
  EXPECT_LT((here.squared_distance.cwiseSqrt() - there.squared_distance.cwiseSqrt())
                .cwiseAbs()
                .maxCoeff(),
            1e-10);
}

TEST(ClosestSurfacePoints, SaysWhatIsWrong) {
  const zoo::Mesh mesh = zoo::tetrahedron();
  const ClosestSurfacePoints closest(mesh.vertices, mesh.faces);
  Points bad = Points::Zero(3, 3);
  bad(1, 2) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(closest.query(Points(0, 3)).map.size(), 0);
  EXPECT_TRUE(fails_with(ErrorCode::not_finite, {"Point 1"}, [&] { closest.query(bad); }));
  EXPECT_TRUE(fails_with(ErrorCode::not_finite, {"Normal 1"},
                         [&] { closest.query(Points::Zero(3, 3), bad, 0.0); }));
  EXPECT_TRUE(fails_with(ErrorCode::wrong_shape, {"3 normals", "2 points"},
                         [&] { closest.query(Points::Zero(2, 3), Points::Zero(3, 3), 0.0); }));
  EXPECT_TRUE(fails_with(ErrorCode::bad_option, {"[-1, 1]"},
                         [&] { closest.query(Points::Zero(1, 3), Points::Zero(1, 3), 1.5); }));
  EXPECT_TRUE(fails_with(ErrorCode::index_out_of_range, {"Face 0"},
                         [&] { ClosestSurfacePoints(mesh.vertices.topRows(1), mesh.faces); }));
  EXPECT_TRUE(fails_with(ErrorCode::empty_mesh, {"4 faces"},
                         [&] { ClosestSurfacePoints(Points::Zero(4, 3), mesh.faces); }));
}

}  // namespace
}  // namespace supple
