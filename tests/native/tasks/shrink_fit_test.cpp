// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>

#include "native/support.h"
#include "supple/tasks/metrics.h"
#include "supple/tasks/transfer.h"

namespace supple {
namespace {

using test::fails_with;

MeshView view(const zoo::Mesh& mesh) { return {mesh.vertices, mesh.faces}; }

// A sphere to be fitted to a lumpy body, and a map that is noisy by an edge or so.
struct Fit {
  zoo::Mesh source = zoo::perturbed_sphere(3, 7);
  zoo::Mesh target = zoo::icosphere(4);
  Points ideal;
  SurfaceMap map;

  static Points lumpy(Points sphere) {
    for (Eigen::Index i = 0; i < sphere.rows(); ++i) {
      const Eigen::RowVector3d p = sphere.row(i).normalized();
      sphere.row(i) = (30.0 + 3.0 * std::sin(4 * p[0]) * std::cos(3 * p[1] + p[2])) *
                      p.cwiseProduct(Eigen::RowVector3d(1.0, 0.7, 1.4));
    }
    return (sphere * test::rotation(2)).rowwise() + Eigen::RowVector3d(100, 0, 0);
  }
  explicit Fit(double noise = 0.1) {
    const Points directions =
        source.vertices + noise * Points(test::noise(source.vertices.rows(), 3, 9));
    map = ClosestSurfacePoints(target.vertices, target.faces).query(directions).map;
    ideal = lumpy(source.vertices);
    target.vertices = lumpy(target.vertices);
  }
};

TEST(ShrinkFit, LaysTheSourceOnTheTargetWithoutTurningFacesOver) {
  const Fit fit;
  const Points raw = apply(fit.map, fit.target.faces, fit.target.vertices);
  ASSERT_GT(flipped_faces(fit.source.vertices, fit.source.faces, raw), 20);
  const ShrinkFit result = shrink_fit(view(fit.source), view(fit.target), fit.map);
  EXPECT_EQ(result.flipped, 0);
  EXPECT_EQ(result.unmapped, 0);
  EXPECT_LT(result.distance.maxCoeff(), 1e-6);
  EXPECT_EQ(result.flipped, flipped_faces(fit.source.vertices, fit.source.faces, result.vertices));
  // Nearer to where the noiseless map goes, and less distorted, than the map itself.
  EXPECT_LT(pose_error(fit.ideal, fit.source.faces, result.vertices, fit.ideal),
            0.6 * pose_error(fit.ideal, fit.source.faces, raw, fit.ideal));
  EXPECT_LT(symmetric_dirichlet(fit.ideal, fit.source.faces, result.vertices),
            0.2 * symmetric_dirichlet(fit.ideal, fit.source.faces, raw));
}

TEST(ShrinkFit, WithoutProjectionItIsNearAndSmooth) {
  const Fit fit;
  ShrinkFitOptions options;
  options.project = false;
  const ShrinkFit result = shrink_fit(view(fit.source), view(fit.target), fit.map, options);
  EXPECT_GT(result.distance.maxCoeff(), 1e-4);
  EXPECT_LT(result.distance.maxCoeff(), 1.5);  // the target is 84 long
}

TEST(ShrinkFit, VerticesWithoutPartnersFollow) {
  Fit fit(0.0);
  for (Eigen::Index i = 0; i < fit.map.size(); i += 5) {
    fit.map.face[i] = -1;
    fit.map.weights.row(i).setZero();
  }
  const ShrinkFit result = shrink_fit(view(fit.source), view(fit.target), fit.map);
  EXPECT_EQ(result.unmapped, (fit.map.size() + 4) / 5);
  EXPECT_EQ(result.flipped, 0);
  EXPECT_LT(pose_error(fit.ideal, fit.source.faces, result.vertices, fit.ideal), 2.0);
}

TEST(ShrinkFit, OfAMeshToItselfMovesLittle) {
  const zoo::Mesh mesh = zoo::torus(40, 20);
  const Eigen::Index n = mesh.vertices.rows();
  const SurfaceMap map =
      surface_map(Eigen::VectorXi::LinSpaced(n, 0, static_cast<int>(n) - 1), mesh.faces, n);
  const ShrinkFit result = shrink_fit(view(mesh), view(mesh), map);
  EXPECT_LT(test::farthest(result.vertices, mesh.vertices), 0.02);
  EXPECT_LT(result.distance.maxCoeff(), 1e-9);
}

class EveryFit : public ::testing::TestWithParam<zoo::Entry> {};
SUPPLE_OVER_THE_ZOO(EveryFit);

TEST_P(EveryFit, IsFiniteAndNearItself) {
  const zoo::Mesh& mesh = GetParam().mesh;
  const SurfaceMap map = ClosestSurfacePoints(mesh.vertices, mesh.faces).query(mesh.vertices).map;
  const ShrinkFit result = shrink_fit(view(mesh), view(mesh), map);
  EXPECT_TRUE(result.vertices.allFinite());
  EXPECT_LT(result.distance.mean(), 0.1 * test::diagonal(mesh.vertices));
}

TEST(ShrinkFit, SaysWhatIsWrong) {
  const Fit fit;
  const auto with = [&](const ShrinkFitOptions& options) {
    return [&, options] { shrink_fit(view(fit.source), view(fit.target), fit.map, options); };
  };
  EXPECT_TRUE(fails_with(ErrorCode::bad_option, {"1 round"}, with({.rounds = 0})));
  EXPECT_TRUE(fails_with(ErrorCode::bad_option, {"growth"}, with({.growth = 0.5})));
  EXPECT_TRUE(fails_with(ErrorCode::wrong_shape, {"source points"},
                         [&] { shrink_fit(view(fit.target), view(fit.source), fit.map); }));
}

}  // namespace
}  // namespace supple
