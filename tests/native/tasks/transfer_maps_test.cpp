// SPDX-License-Identifier: GPL-3.0-or-later
#include "native/support.h"
#include "supple/geometry/operators.h"
#include "supple/tasks/transfer.h"

namespace supple {
namespace {

using test::fails_with;

MeshView view(const zoo::Mesh& mesh) { return {mesh.vertices, mesh.faces}; }

SurfaceMap closest(const zoo::Mesh& to, const Points& points) {
  return ClosestSurfacePoints(to.vertices, to.faces).query(points).map;
}

TEST(ReversedMap, OfTheIdentityIsTheIdentity) {
  const zoo::Mesh mesh = zoo::torus(24, 12);
  const Eigen::Index n = mesh.vertices.rows();
  const Eigen::VectorXi identity = Eigen::VectorXi::LinSpaced(n, 0, static_cast<int>(n) - 1);
  const SurfaceMap map = reversed(surface_map(identity, mesh.faces, n), view(mesh), view(mesh));
  EXPECT_EQ(nearest_corners(map, mesh.faces), identity);
}

TEST(ReversedMap, GoesBackBetweenTriangulationsOfOneSurface) {
  const zoo::Mesh from = zoo::torus(40, 20), to = zoo::torus(33, 27);
  // Somewhere else and turned: only the map says what belongs together.
  const Points elsewhere =
      (3.0 * from.vertices * test::rotation(2)).rowwise() + Eigen::RowVector3d(9, 0, 0);
  const SurfaceMap forward = closest(to, from.vertices);
  const SurfaceMap back = reversed(forward, {elsewhere, from.faces}, view(to));
  check_surface_map(back, to.vertices.rows(), from.faces);
  EXPECT_LT(test::farthest(apply(back, from.faces, from.vertices), to.vertices), 0.05);
}

TEST(ReversedMap, LeavesOutFacesWithoutPartners) {
  const zoo::Mesh mesh = zoo::grid(8, 8, 1.0);
  const Eigen::Index n = mesh.vertices.rows();
  Eigen::VectorXi half = Eigen::VectorXi::LinSpaced(n, 0, static_cast<int>(n) - 1);
  for (Eigen::Index i = 0; i < n; ++i) {
    half[i] = mesh.vertices(i, 0) > 4.5 ? -1 : half[i];
  }
  const SurfaceMap map = reversed(surface_map(half, mesh.faces, n), view(mesh), view(mesh));
  EXPECT_LT(apply(map, mesh.faces, mesh.vertices).col(0).maxCoeff(), 4.0 + 1e-12);
  half.setConstant(-1);
  EXPECT_TRUE(fails_with(ErrorCode::empty_mesh, {"no surface"}, [&] {
    reversed(surface_map(half, mesh.faces, n), view(mesh), view(mesh));
  }));
}

// Two balls that cut into each other, and the same with other triangles.
struct Balls {
  zoo::Mesh source = zoo::joined(zoo::icosphere(3), zoo::moved(zoo::icosphere(3), {1.95, 0, 0}));
  zoo::Mesh target = zoo::joined(zoo::perturbed_sphere(3, 2),
                                 zoo::moved(zoo::perturbed_sphere(3, 5), {1.95, 0, 0}));
  Eigen::Index source_half = source.vertices.rows() / 2;
  Eigen::Index target_half = target.vertices.rows() / 2;
  SurfaceMap map = closest(source, target.vertices);

  bool on_first(const SurfaceMap& of, Eigen::Index i) const {
    return source.faces(of.face[i], 0) < source_half;
  }
  int strays(const SurfaceMap& of) const {
    int count = 0;
    for (Eigen::Index i = 0; i < of.size(); ++i) {
      count += on_first(of, i) != (i < target_half) ? 1 : 0;
    }
    return count;
  }
};

TEST(Islands, WhatStraysGoesBackToItsIsland) {
  const Balls balls;
  ASSERT_GT(balls.strays(balls.map), 0);
  const IslandMap held = within_islands(balls.map, view(balls.source), balls.target.faces);
  EXPECT_EQ(held.islands, 2);
  EXPECT_EQ(held.moved, balls.strays(balls.map));
  EXPECT_EQ(balls.strays(held.map), 0);
  const Points at = apply(held.map, balls.source.faces, balls.source.vertices);
  EXPECT_LT(test::farthest(at, balls.target.vertices), 0.3);
  for (Eigen::Index i = 0; i < balls.map.size(); ++i) {
    if (balls.on_first(balls.map, i) == (i < balls.target_half)) {
      EXPECT_EQ(held.map.face[i], balls.map.face[i]);
    }
  }
}

TEST(Islands, ASkinOverTwoPartsStaysOnBoth) {
  const Balls balls;
  Faces bridged(balls.target.faces.rows() + 1, 3);
  bridged << balls.target.faces, 0, 1, static_cast<int>(balls.target_half);
  const IslandMap held = within_islands(balls.map, view(balls.source), bridged);
  EXPECT_EQ(held.moved, 0);
  EXPECT_EQ(held.map.face, balls.map.face);
  EXPECT_TRUE(fails_with(ErrorCode::bad_option, {"0.4"},
                         [&] { within_islands(balls.map, view(balls.source), bridged, 0.4); }));
}

TEST(Islands, NearlyAllIsAllWhoeverOwnsTheRest) {
  const Balls balls;
  // The target's second ball is not there, so nothing else covers the source's.
  zoo::Mesh first = zoo::perturbed_sphere(3, 2);
  const SurfaceMap map = closest(balls.source, first.vertices);
  ASSERT_GT(balls.strays(map), 0);
  EXPECT_EQ(balls.strays(within_islands(map, view(balls.source), first.faces, 0.6).map), 0);
  EXPECT_EQ(within_islands(map, view(balls.source), first.faces, 1.0).moved, 0);
}

TEST(TransferGroups, DoNotBleedAndStayNormalised) {
  const Balls balls;
  RowMatrix<double> weights = RowMatrix<double>::Zero(balls.source.vertices.rows(), 3);
  for (Eigen::Index i = 0; i < weights.rows(); ++i) {
    if (i < balls.source_half) {
      const double share = 0.5 + 0.5 * balls.source.vertices(i, 2);
      weights.row(i) << share, 1.0 - share, 0.0;
    } else {
      weights(i, 2) = 1.0;
    }
  }
  const TransferredGroups result =
      transfer_groups(balls.map, view(balls.source), balls.target.faces, weights);
  EXPECT_TRUE(result.normalised);
  EXPECT_EQ(result.unmapped, 0);
  EXPECT_GT(result.moved, 0);
  const Eigen::Index half = balls.target_half;
  EXPECT_EQ(result.weights.topRows(half).col(2).maxCoeff(), 0.0);
  EXPECT_EQ(result.weights.bottomRows(half).leftCols(2).maxCoeff(), 0.0);
  EXPECT_LT((result.weights.rowwise().sum().array() - 1.0).abs().maxCoeff(), 1e-12);
  EXPECT_TRUE(((result.weights.array() == 0.0) || (result.weights.array() >= 1e-4)).all());
  // Smooth ones are what they are there: z is a linear function.
  EXPECT_LT((result.weights.topRows(half).col(0) -
             (0.5 + 0.5 * balls.target.vertices.topRows(half).col(2).array()).matrix())
                .cwiseAbs()
                .maxCoeff(),
            0.15);  // strays come from up to 0.3 away
}

TEST(TransferGroups, WeightsThatDoNotSumToOneKeepTheirSums) {
  const zoo::Mesh mesh = zoo::grid(4, 4, 1.0);
  RowMatrix<double> weights = RowMatrix<double>::Constant(mesh.vertices.rows(), 2, 0.2);
  weights(3, 1) = 5e-5;
  SurfaceMap map = closest(mesh, mesh.vertices);
  map.face[7] = -1;
  const TransferredGroups result = transfer_groups(map, view(mesh), mesh.faces, weights);
  EXPECT_FALSE(result.normalised);
  EXPECT_EQ(result.unmapped, 1);
  EXPECT_TRUE(result.weights.row(7).isZero(0.0));
  EXPECT_EQ(result.weights(3, 1), 0.0);
  EXPECT_NEAR(result.weights(3, 0), 0.20005, 1e-12);
  EXPECT_NEAR(result.weights(5, 0), 0.2, 1e-12);
  weights(2, 0) = -0.1;
  EXPECT_TRUE(fails_with(ErrorCode::bad_option, {"Vertex 2", "below 0"},
                         [&] { transfer_groups(map, view(mesh), mesh.faces, weights); }));
  EXPECT_TRUE(fails_with(ErrorCode::wrong_shape, {"3 vertices", "25"}, [&] {
    transfer_groups(map, view(mesh), mesh.faces, weights.topRows(3));
  }));
}

TEST(TransferField, IsLinearInsideFacesAndCountsWhatHasNoPartner) {
  const zoo::Mesh source = zoo::grid(5, 5, 1.0);
  Points points = 2.5 * Points(test::noise(50, 3, 4)).array() + 2.5;
  points.col(2).setZero();
  SurfaceMap map = closest(source, points);
  map.face[9] = -1;
  const TransferredField result =
      transfer_field(map, source.faces, RowMatrix<double>(source.vertices), -3.0);
  EXPECT_EQ(result.unmapped, 1);
  EXPECT_TRUE((result.values.row(9).array() == -3.0).all());
  points.row(9).setConstant(-3.0);
  EXPECT_LT(test::farthest(result.values, points), 1e-12);
}

}  // namespace
}  // namespace supple
