// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/tasks/initial_map.h"

#include <Eigen/LU>
#include <cmath>
#include <random>

#include "native/support.h"
#include "supple/spectral/descriptors.h"
#include "supple/spectral/map_fit.h"

namespace supple {
namespace {

// Without symmetry: a bent sphere with bumps.
zoo::Mesh lump() {
  zoo::Mesh mesh = zoo::perturbed_sphere(3, 2);
  for (Eigen::Index i = 0; i < mesh.vertices.rows(); ++i) {
    const Eigen::RowVector3d v = mesh.vertices.row(i);
    mesh.vertices.row(i) *= 1.0 + 0.3 * std::sin(3.0 * v[0] + 1.0) + 0.2 * v[1] * v[2] + 0.4 * v[0];
  }
  mesh.vertices.col(2) *= 1.7;
  return mesh;
}

struct Copy {
  zoo::Mesh mesh;
  Eigen::VectorXi place;  // of each vertex of the original
};

Copy turned_copy(const zoo::Mesh& mesh, unsigned seed) {
  const Eigen::Index n = mesh.vertices.rows();
  Copy copy{mesh, Eigen::VectorXi::LinSpaced(n, 0, static_cast<int>(n) - 1)};
  std::mt19937 generator(seed);
  for (Eigen::Index i = n - 1; i > 0; --i) {
    std::swap(copy.place[i], copy.place[static_cast<Eigen::Index>(generator() % (i + 1))]);
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    copy.mesh.vertices.row(copy.place[i]) = 5.0 * mesh.vertices.row(i) * test::rotation(seed);
  }
  copy.mesh.vertices.rowwise() += Eigen::RowVector3d(1, 2, 3);
  for (int& index : copy.mesh.faces.reshaped()) {
    index = copy.place[index];
  }
  return copy;
}

PreparedMesh prepared(const zoo::Mesh& mesh) { return {mesh.vertices, mesh.faces}; }

double share_right(const Eigen::VectorXi& map, const Eigen::VectorXi& truth) {
  return static_cast<double>((map.array() == truth.array()).count()) /
         static_cast<double>(map.size());
}

TEST(InitialMap, ATurnedScaledShuffledCopyComesBackEveryWay) {
  const zoo::Mesh mesh = lump();
  const Copy copy = turned_copy(mesh, 4);
  const PreparedMesh source = prepared(mesh), target = prepared(copy.mesh);
  const InitialMap automatic = automatic_map(source, target), nearest = nearest_map(source, target);
  EXPECT_GT(share_right(automatic.point_map, copy.place), 0.99);
  EXPECT_GT(share_right(nearest.point_map, copy.place), 0.99);
  EXPECT_GT(automatic.score.value(), 0.95);
  Eigen::VectorXi landmarks(3), images(3);
  landmarks << 3, 200, 400;
  images = copy.place(landmarks);
  const InitialMap clicked = landmark_map(source, target, landmarks, images);
  EXPECT_GT(share_right(clicked.point_map, copy.place), 0.99);
}

TEST(InitialMap, AnotherTriangulationOfTheSameShape) {
  const zoo::Mesh fine = lump();
  // The same surface, vertices moved along it by sampling another perturbed sphere.
  zoo::Mesh other = zoo::perturbed_sphere(3, 9);
  for (Eigen::Index i = 0; i < other.vertices.rows(); ++i) {
    const Eigen::RowVector3d v = other.vertices.row(i);
    other.vertices.row(i) *=
        1.0 + 0.3 * std::sin(3.0 * v[0] + 1.0) + 0.2 * v[1] * v[2] + 0.4 * v[0];
  }
  other.vertices.col(2) *= 1.7;
  const PreparedMesh source = prepared(fine), target = prepared(other);
  const InitialMap found = automatic_map(source, target);
  // The true partner is at the same place in space: within about an edge.
  double away = 0.0;
  for (Eigen::Index i = 0; i < fine.vertices.rows(); ++i) {
    away += (other.vertices.row(found.point_map[i]) - fine.vertices.row(i)).norm();
  }
  EXPECT_LT(away / static_cast<double>(fine.vertices.rows()), 0.04 * test::diagonal(fine.vertices));
  EXPECT_GT(found.score.orientation, 0.9);
}

TEST(InitialMap, LandmarksAreExactEvenWhereTheyAreOdd) {
  const zoo::Mesh mesh = lump();
  const PreparedMesh source = prepared(mesh);
  Eigen::VectorXi from(4), to(4);
  from << 0, 100, 300, 500;
  to << 2, 101, 300, 505;
  const InitialMap found = landmark_map(source, source, from, to);
  EXPECT_EQ(found.point_map(from), to);
}

TEST(InitialMap, BrokenMeshesAreMapped) {
  const zoo::Mesh mesh = zoo::with_zero_area_faces(zoo::with_unused_vertices(lump()));
  const PreparedMesh source = prepared(mesh);
  const InitialMap found = nearest_map(source, source, true);
  ASSERT_EQ(found.point_map.size(), mesh.vertices.rows());
  EXPECT_GT(share_right(found.point_map,
                        Eigen::VectorXi::LinSpaced(mesh.vertices.rows(), 0,
                                                   static_cast<int>(mesh.vertices.rows()) - 1)),
            0.95);
  EXPECT_EQ(automatic_map(source, source).point_map.size(), mesh.vertices.rows());
}

TEST(InitialMap, Errors) {
  const zoo::Mesh mesh = lump();
  const PreparedMesh source = prepared(mesh), tiny = prepared(zoo::tetrahedron());
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"eigenfunctions", "landmarks"},
                               [&] { automatic_map(source, tiny); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"1", "2"}, [&] {
    landmark_map(source, source, Eigen::VectorXi::Zero(1), Eigen::VectorXi::Zero(2));
  }));
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"Vertex 0", "two landmarks"}, [&] {
    landmark_map(source, source, Eigen::Vector2i(0, 0), Eigen::Vector2i(0, 1));
  }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"UVs", "2"}, [&] {
    uv_map(source, source, RowMatrix<double>::Zero(3, 2), RowMatrix<double>::Zero(3, 2));
  }));
  Progress progress;
  progress.cancel();
  EXPECT_TRUE(test::fails_with(ErrorCode::cancelled, {},
                               [&] { automatic_map(source, source, ProgressRange(&progress)); }));
}

// --- descriptors
// ---------------------------------------------------------------------------------

TEST(Descriptors, HeatIsKeptAndSymmetric) {
  const PreparedMesh mesh = prepared(lump());
  const Eigen::Vector2d times(0.01, 0.5);
  const RowMatrix<double> heat = heat_kernel(mesh.basis, 5, times);
  // A unit of heat stays a unit.
  EXPECT_NEAR(mesh.basis.mass.dot(heat.col(0)), 1.0, 1e-6);
  EXPECT_NEAR(heat_kernel(mesh.basis, 9, times)(5, 0), heat(9, 0), 1e-9);
  EXPECT_NEAR(heat_kernel_signature(mesh.basis, times)(5, 1), heat(5, 1), 1e-9);
}

TEST(Descriptors, WaveSignatureIsThatOfAScaledCopy) {
  const zoo::Mesh mesh = lump();
  const Copy copy = turned_copy(mesh, 3);
  const PreparedMesh a = prepared(mesh), b = prepared(copy.mesh);
  const WaveEnergies waves = wave_energies(a.basis, b.basis, 20);
  const RowMatrix<double> one = wave_kernel_signature(a.basis, waves.energies, waves.sigma);
  const RowMatrix<double> other = wave_kernel_signature(b.basis, waves.energies, waves.sigma);
  EXPECT_LT((one - other(copy.place, Eigen::all)).cwiseAbs().maxCoeff(), 1e-5 * one.maxCoeff());
  // Each energy's mean over the surface is 1: the weights sum to 1 and the functions have norm 1.
  const Eigen::VectorXd means = one.transpose() * a.basis.mass;
  EXPECT_LT((means.array() - 1.0).abs().maxCoeff(), 1e-6);
}

TEST(Descriptors, OrientationOperatorChangesSignWithTheSurface) {
  const zoo::Mesh mesh = lump();
  const PreparedMesh a = prepared(mesh);
  Faces reversed = a.operators.faces;
  reversed.col(1).swap(reversed.col(2));
  const Eigen::VectorXd field = a.operators.vertices.col(0);
  const auto one = orientation_operator(a.basis, a.operators.faces, field, 12);
  const auto other = orientation_operator(a.basis, reversed, field, 12);
  EXPECT_GT(one.norm(), 1e-3);
  EXPECT_LT((one + other).norm(), 1e-12 * one.norm());
  // n . (grad f x grad h) integrates to 0 on a closed surface.
  EXPECT_LT(one.row(0).norm(), 1e-9 * one.norm());
}

TEST(MapFit, KnownFunctionsGiveTheKnownMap) {
  const PreparedMesh mesh = prepared(lump());
  const Eigen::Index k = 10;
  MapConstraints constraints;
  constraints.target = test::noise(k, 30, 1);
  const RowMatrix<double> truth = test::noise(k, k, 2);
  constraints.source = truth * constraints.target;
  constraints.commuting = 0.0;
  const Eigen::VectorXd values = mesh.basis.values.head(k);
  EXPECT_LT((fit_functional_map(values, values, constraints) - truth).norm(), 1e-5);
  // An operator that the truth respects does not move it.
  const RowMatrix<double> on_target = test::noise(k, k, 3);
  constraints.operators.emplace_back(truth * on_target * RowMatrix<double>(truth.inverse()),
                                     on_target);
  EXPECT_LT((fit_functional_map(values, values, constraints) - truth).norm(), 1e-4);
}

}  // namespace
}  // namespace supple
