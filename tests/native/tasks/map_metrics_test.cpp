// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/tasks/map_metrics.h"

#include <cmath>

#include "native/support.h"
#include "supple/geometry/operators.h"

namespace supple {
namespace {

TriangleMesh mesh_of(const zoo::Mesh& mesh) { return {mesh.vertices, mesh.faces}; }
Eigen::VectorXi identity(Eigen::Index n) {
  return Eigen::VectorXi::LinSpaced(n, 0, static_cast<int>(n) - 1);
}

TEST(MapMetrics, IdentityOfAScaledCopy) {
  const zoo::Mesh mesh = zoo::perturbed_sphere(3, 1);
  const TriangleMesh source = mesh_of(mesh), target = mesh_of(zoo::moved(mesh, {1, 2, 3}, 40.0));
  const Eigen::VectorXi map = identity(mesh.vertices.rows());
  EXPECT_NEAR(map_dirichlet(source, target, map), 2.0, 1e-9);
  EXPECT_NEAR(coverage(source, target, map), 100.0, 1e-9);
  EXPECT_EQ(vertex_inversion(source, target, map), 0.0);
  EXPECT_EQ(face_inversion(source, target, map), 0.0);
}

TEST(MapMetrics, MirroringInvertsEveryFaceAndVertexAndKeepsTheEnergy) {
  const zoo::Mesh mesh = zoo::icosphere(2);
  const TriangleMesh sphere = mesh_of(mesh);
  Eigen::VectorXi mirrored(mesh.vertices.rows());
  Points reflected = mesh.vertices;
  reflected.col(0) *= -1.0;
  for (Eigen::Index i = 0; i < mirrored.size(); ++i) {
    ASSERT_LT(
        (mesh.vertices.rowwise() - reflected.row(i)).rowwise().squaredNorm().minCoeff(&mirrored[i]),
        1e-12);
  }
  EXPECT_EQ(face_inversion(sphere, sphere, mirrored), 100.0);
  EXPECT_EQ(vertex_inversion(sphere, sphere, mirrored), 100.0);
  EXPECT_NEAR(map_dirichlet(sphere, sphere, mirrored), 2.0, 1e-9);
  EXPECT_NEAR(coverage(sphere, sphere, mirrored), 100.0, 1e-9);
}

TEST(MapMetrics, ConstantMapHasNoEnergyNoInversionAndOneVertexOfCoverage) {
  const zoo::Mesh mesh = zoo::perturbed_sphere(2, 5);
  const TriangleMesh sphere = mesh_of(mesh);
  const Eigen::VectorXi map = Eigen::VectorXi::Constant(mesh.vertices.rows(), 3);
  const Eigen::VectorXd mass = lumped_mass(mesh.vertices, mesh.faces);
  EXPECT_NEAR(map_dirichlet(sphere, sphere, map), 0.0, 1e-12);
  EXPECT_EQ(face_inversion(sphere, sphere, map), 0.0);
  EXPECT_NEAR(coverage(sphere, sphere, map), 100.0 * mass[3] / mass.sum(), 1e-9);
}

TEST(MapMetrics, TwoSwappedVerticesOfATetrahedronInvertItsFacesByHand) {
  // Swapping two corners of a tetrahedron turns over the two faces that have both (their image is
  // the same face, the other way round) and exchanges the other two, which turn over as well.
  const TriangleMesh mesh = mesh_of(zoo::tetrahedron());
  EXPECT_EQ(face_inversion(mesh, mesh, Eigen::Vector4i(1, 0, 2, 3)), 100.0);
  // A cyclic exchange of three keeps the orientation.
  EXPECT_EQ(face_inversion(mesh, mesh, Eigen::Vector4i(1, 2, 0, 3)), 0.0);
}

TEST(MapMetrics, OneVertexMovedAcrossAnEdgeOfAGrid) {
  // 3 x 3 cells. Moving the image of an inner vertex two cells right turns over the faces that it
  // passes: counted here by signed areas in the plane.
  const zoo::Mesh mesh = zoo::grid(4, 4, 1.0);
  const TriangleMesh grid = mesh_of(mesh);
  const Eigen::Index n = mesh.vertices.rows();
  const auto at = [&](double x, double y) {
    Eigen::Index i;
    (mesh.vertices.rowwise() - Eigen::RowVector3d(x, y, 0)).rowwise().squaredNorm().minCoeff(&i);
    return static_cast<int>(i);
  };
  Eigen::VectorXi map = identity(n);
  map[at(1, 1)] = at(3, 1);
  int turned = 0;
  for (const auto& face : mesh.faces.rowwise()) {
    const Eigen::RowVector3d a = mesh.vertices.row(map[face[0]]);
    const Eigen::RowVector3d b = mesh.vertices.row(map[face[1]]) - a,
                             c = mesh.vertices.row(map[face[2]]) - a;
    turned += b[0] * c[1] - b[1] * c[0] < 0.0 ? 1 : 0;
  }
  ASSERT_GT(turned, 0);
  EXPECT_NEAR(face_inversion(grid, grid, map), 100.0 * turned / mesh.faces.rows(), 1e-12);
}

TEST(MapMetrics, GeodesicErrorOfOneEdge) {
  const zoo::Mesh mesh = zoo::moved(zoo::grid(5, 4, 1.0), {0, 0, 0}, 3.0);
  const double area = face_areas(mesh.vertices, mesh.faces).sum();
  const Geodesics geodesics(mesh.vertices, mesh.faces);
  // Every point one edge off, exactly right, and three columns and a row away.
  const auto truth = Eigen::VectorXi::Constant(1, 0);
  Eigen::Index edge, far;
  (mesh.vertices.rowwise() - Eigen::RowVector3d(3, 0, 0)).rowwise().squaredNorm().minCoeff(&edge);
  (mesh.vertices.rowwise() - Eigen::RowVector3d(9, 3, 0)).rowwise().squaredNorm().minCoeff(&far);
  RowMatrix<int> images(1, 3);
  images << static_cast<int>(edge), 0, static_cast<int>(far);
  const auto errors = geodesic_errors(geodesics, area, truth, images);
  ASSERT_EQ(errors.size(), 3U);
  EXPECT_NEAR(errors[0].mean, 300.0 / std::sqrt(area), 1e-9);
  EXPECT_EQ(errors[1].mean, 0.0);
  EXPECT_NEAR(errors[2].mean, 100.0 * std::sqrt(90.0) / std::sqrt(area), 1e-9);
}

TEST(MapMetrics, UnreachablePointsAreCountedNotAveraged) {
  const zoo::Mesh mesh = zoo::two_spheres(1);
  const Geodesics geodesics(mesh.vertices, mesh.faces);
  const auto n = static_cast<int>(mesh.vertices.rows());
  RowMatrix<int> images(2, 1);
  images << 0, n - 1;
  const auto errors = geodesic_errors(geodesics, 1.0, Eigen::Vector2i(0, 0), images);
  EXPECT_EQ(errors[0].unreachable, 1);
  EXPECT_EQ(errors[0].mean, 0.0);
}

TEST(MapMetrics, UnusedVerticesAndFacesWithoutAreaChangeNothing) {
  const zoo::Mesh clean = zoo::perturbed_sphere(2, 5);
  const zoo::Mesh broken = zoo::with_unused_vertices(clean);
  const TriangleMesh source = mesh_of(broken);
  const Eigen::VectorXi map = identity(broken.vertices.rows());
  EXPECT_NEAR(map_dirichlet(source, source, map), 2.0, 1e-9);
  EXPECT_NEAR(coverage(source, source, map), 100.0, 1e-9);
  EXPECT_EQ(face_inversion(source, source, map), 0.0);
}

TEST(MapMetrics, Chamfer) {
  Points a(2, 3), b(1, 3);
  a << 0, 0, 0, 2, 0, 0;
  b << 0, 1, 0;
  EXPECT_NEAR(chamfer(a, b), (1.0 + std::sqrt(5.0)) / 2.0 + 1.0, 1e-12);
  EXPECT_EQ(chamfer(a, a), 0.0);
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"0"}, [&] { chamfer(a, Points(0, 3)); }));
}

TEST(MapMetrics, BadMapsAreNamed) {
  const TriangleMesh mesh = mesh_of(zoo::cube());
  Eigen::VectorXi map = identity(8);
  map[5] = 8;
  EXPECT_TRUE(test::fails_with(ErrorCode::index_out_of_range, {"Entry 5", "8 vertices"},
                               [&] { coverage(mesh, mesh, map); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"7 entries", "8"},
                               [&] { map_dirichlet(mesh, mesh, identity(7)); }));
}

}  // namespace
}  // namespace supple
