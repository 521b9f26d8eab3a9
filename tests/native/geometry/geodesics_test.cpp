// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/geodesics.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <queue>

#include "native/support.h"
#include "supple/geometry/mesh.h"

namespace supple {
namespace {

Geodesics geodesics_of(const zoo::Mesh& mesh) { return {mesh.vertices, mesh.faces}; }

// Along edges only: an upper bound from other code.
Eigen::VectorXd along_edges(const zoo::Mesh& mesh, int source) {
  Eigen::VectorXd best =
      Eigen::VectorXd::Constant(mesh.vertices.rows(), std::numeric_limits<double>::infinity());
  best[source] = 0.0;
  for (bool changed = true; changed;) {
    changed = false;
    for (const auto& face : mesh.faces.rowwise()) {
      for (int c = 0; c < 3; ++c) {
        const int a = face[c], b = face[(c + 1) % 3];
        const double length = (mesh.vertices.row(a) - mesh.vertices.row(b)).norm();
        for (const auto& [from, to] : {std::pair(a, b), std::pair(b, a)}) {
          if (best[from] + length < best[to] * (1.0 - 1e-14)) {
            best[to] = best[from] + length;
            changed = true;
          }
        }
      }
    }
  }
  return best;
}

TEST(Geodesics, PlaneDistancesAreEuclideanBetweenAnyTwoVertices) {
  zoo::Mesh mesh = zoo::grid(9, 7, 0.3);
  // Inner vertices moved at random in the plane: no two paths along edges are straight.
  const RowMatrix<double> jitter = test::noise(mesh.vertices.rows(), 2, 3);
  const Eigen::RowVector3d high = mesh.vertices.colwise().maxCoeff();
  for (Eigen::Index i = 0; i < mesh.vertices.rows(); ++i) {
    const auto v = mesh.vertices.row(i);
    if (v[0] > 0 && v[1] > 0 && v[0] < high[0] && v[1] < high[1]) {
      mesh.vertices.row(i).head(2) += 0.08 * jitter.row(i);
    }
  }
  mesh.vertices *= test::rotation(2);
  const Geodesics geodesics = geodesics_of(mesh);
  for (int source = 0; source < mesh.vertices.rows(); ++source) {
    const Eigen::VectorXd lengths = geodesics.distances(source);
    const Eigen::VectorXd straight =
        (mesh.vertices.rowwise() - mesh.vertices.row(source)).rowwise().norm();
    ASSERT_LT((lengths - straight).cwiseAbs().maxCoeff(), 1e-9) << source;
  }
}

TEST(Geodesics, RegularGridWhereLinesPassThroughVertices) {
  const zoo::Mesh mesh = zoo::grid(6, 6, 1.0);
  const Geodesics geodesics = geodesics_of(mesh);
  for (int source = 0; source < mesh.vertices.rows(); ++source) {
    const Eigen::VectorXd straight =
        (mesh.vertices.rowwise() - mesh.vertices.row(source)).rowwise().norm();
    ASSERT_LT((geodesics.distances(source) - straight).cwiseAbs().maxCoeff(), 1e-9) << source;
  }
}

TEST(Geodesics, CubeUnfolds) {
  const zoo::Mesh mesh = zoo::cube();
  const Geodesics geodesics = geodesics_of(mesh);
  for (int a = 0; a < 8; ++a) {
    const Eigen::VectorXd lengths = geodesics.distances(a);
    for (int b = 0; b < 8; ++b) {
      const double differing = (mesh.vertices.row(a) - mesh.vertices.row(b)).cwiseAbs().sum();
      const double truth = differing > 2.5   ? std::sqrt(5.0)
                           : differing > 1.5 ? std::sqrt(2.0)
                                             : differing;
      EXPECT_NEAR(lengths[b], truth, 1e-12) << a << " " << b;
    }
  }
}

TEST(Geodesics, SphereConvergesWithTheSquareOfTheEdge) {
  double before = 0.0;
  for (const int levels : {2, 3, 4}) {
    const zoo::Mesh mesh = zoo::icosphere(levels);
    const Eigen::VectorXd lengths = geodesics_of(mesh).distances(7);
    const Eigen::VectorXd angles = (mesh.vertices * mesh.vertices.row(7).transpose())
                                       .cwiseMax(-1.0)
                                       .cwiseMin(1.0)
                                       .array()
                                       .acos();
    // A polyhedron inside the sphere: never longer than the great circle plus rounding.
    EXPECT_LT((lengths - angles).maxCoeff(), 1e-6);
    const double error = (lengths - angles).cwiseAbs().maxCoeff();
    if (before > 0.0) {
      EXPECT_LT(error, before / 3.0);
    }
    before = error;
  }
  EXPECT_LT(before, 0.01);
}

TEST(Geodesics, BoundariesAreWalkedAround) {
  // A flat ring: the inner boundary bends the path of opposite points. Rings of the disc but the
  // first two are kept.
  zoo::Mesh mesh = zoo::disc(12, 48);
  std::vector<int> kept;
  const double radius = mesh.vertices.rowwise().norm().maxCoeff();
  const double hole = radius * 0.49;
  for (int f = 0; f < mesh.faces.rows(); ++f) {
    bool outside = true;
    for (int c = 0; c < 3; ++c) {
      outside = outside && mesh.vertices.row(mesh.faces(f, c)).norm() > hole;
    }
    if (outside) {
      kept.push_back(f);
    }
  }
  mesh.faces = Faces(mesh.faces(kept, Eigen::all));
  Eigen::Index a, b;
  mesh.vertices.col(0).maxCoeff(&a);
  (mesh.vertices.rowwise() + mesh.vertices.row(a)).rowwise().norm().minCoeff(&b);
  const double inner = radius * 0.5;
  // Tangent, around the circle (here a 48-gon, a little shorter), tangent.
  const double tangent = std::sqrt(radius * radius - inner * inner);
  const double arc = std::numbers::pi - 2.0 * std::acos(inner / radius);
  const double length = geodesics_of(mesh).distances(static_cast<int>(a))[b];
  EXPECT_LT(length, 2.0 * tangent + inner * arc + 1e-9);
  EXPECT_GT(length, 2.0 * tangent + inner * arc * 0.99);
}

class GeodesicsOverZoo : public ::testing::TestWithParam<zoo::Entry> {};

TEST_P(GeodesicsOverZoo, AreAMetricBelowTheWayAlongEdges) {
  const zoo::Mesh& mesh = GetParam().mesh;
  const TriangleMesh checked(mesh.vertices, mesh.faces);
  const Geodesics geodesics = geodesics_of(mesh);
  const auto n = static_cast<int>(mesh.vertices.rows());
  Faces kept = checked.surface_faces();
  for (int& index : kept.reshaped()) {
    index = checked.mesh_vertex()[index];
  }
  const zoo::Mesh surface{mesh.vertices, kept};
  const int step = std::max(1, n / 7);
  RowMatrix<double> all(n, n);
  for (int v = 0; v < n; v += step) {
    all.row(v) = geodesics.distances(v).transpose();
    const Eigen::VectorXd edges = along_edges(surface, v);
    for (int w = 0; w < n; ++w) {
      const double straight = (mesh.vertices.row(v) - mesh.vertices.row(w)).norm();
      ASSERT_EQ(std::isfinite(all(v, w)), std::isfinite(edges[w])) << v << " " << w;
      ASSERT_GE(all(v, w), straight * (1.0 - 1e-9)) << v << " " << w;
      if (std::isfinite(edges[w])) {
        ASSERT_LE(all(v, w), edges[w] * (1.0 + 1e-9)) << v << " " << w;
      }
    }
  }
  for (int v = 0; v < n; v += step) {
    for (int w = 0; w < n; w += step) {
      if (std::isfinite(all(v, w))) {
        EXPECT_NEAR(all(v, w), all(w, v), 1e-8 * std::max(all(v, w), 1e-3)) << v << " " << w;
      }
    }
  }
}
SUPPLE_OVER_THE_ZOO(GeodesicsOverZoo);

TEST(Geodesics, BetweenIsWhatDistancesFinds) {
  const zoo::Mesh mesh = zoo::perturbed_sphere(3, 4);
  const Geodesics geodesics = geodesics_of(mesh);
  const auto n = static_cast<int>(mesh.vertices.rows());
  Eigen::VectorXi sources(40);
  RowMatrix<int> targets(40, 3);
  for (int i = 0; i < 40; ++i) {
    sources[i] = (i * 37) % 17;  // several rows of a source
    targets.row(i) << (i * 101) % n, sources[i], (i * 13 + 5) % n;
  }
  const RowMatrix<double> lengths = geodesics.between(sources, targets);
  for (int i = 0; i < 40; ++i) {
    const Eigen::VectorXd all = geodesics.distances(sources[i]);
    for (int j = 0; j < 3; ++j) {
      EXPECT_NEAR(lengths(i, j), all[targets(i, j)], 1e-9);
    }
    EXPECT_EQ(lengths(i, 1), 0.0);
  }
}

TEST(Geodesics, Errors) {
  const zoo::Mesh mesh = zoo::cube();
  const Geodesics geodesics = geodesics_of(mesh);
  EXPECT_TRUE(
      test::fails_with(ErrorCode::index_out_of_range, {"8"}, [&] { geodesics.distances(8); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"1", "2"}, [&] {
    geodesics.between(Eigen::VectorXi::Zero(1), RowMatrix<int>::Zero(2, 1));
  }));
  Progress progress;
  progress.cancel();
  EXPECT_TRUE(test::fails_with(ErrorCode::cancelled, {}, [&] {
    geodesics.between(Eigen::VectorXi::Zero(1), RowMatrix<int>::Zero(1, 1),
                      ProgressRange(&progress));
  }));
}

}  // namespace
}  // namespace supple
