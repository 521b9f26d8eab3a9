// SPDX-License-Identifier: GPL-3.0-or-later
// The slider from natural to stiff, and ARAP beside it.
#include <cmath>

#include "native/tasks/editing.h"
#include "supple/geometry/mesh.h"
#include "supple/tasks/metrics.h"
#include "tasks/edit/energies.h"

namespace supple {
namespace {

class Stiffness : public ::testing::Test {
 protected:
  double dirichlet(const EditOptions& options) const {
    return symmetric_dirichlet(mesh.vertices, mesh.faces,
                               editor->solve(edit.targets, options).vertices);
  }
  // In units of the surface; every vertex of this mesh is one of its surface, in order.
  double arap(const EditOptions& options) const {
    const double unit = std::sqrt(face_areas(mesh.vertices, mesh.faces).sum());
    Points gradient;
    return ArapEnergy(prepared->operators)
        .evaluate(editor->solve(edit.targets, options).vertices / unit, gradient);
  }
  zoo::Mesh mesh = zoo::square_tower(3, 9);
  test::Edit edit = test::bending(mesh.vertices);
  std::shared_ptr<const PreparedMesh> prepared = test::prepared(mesh);
  std::shared_ptr<const Editor> editor =
      std::make_shared<Editor>(prepared, edit.handles, test::editing_network());
};

TEST_F(Stiffness, StiffDistortsLessThanNatural) {
  const double natural = dirichlet({}), half = dirichlet({.stiffness = 0.5}),
               stiff = dirichlet({.stiffness = 1.0});
  EXPECT_LT(half, natural);
  EXPECT_LT(stiff, half);
  EXPECT_LE(stiff, dirichlet({.method = EditMethod::arap}));
}

TEST_F(Stiffness, StiffTurnsNoFaceOver) {
  for (const Eigen::Index each : {6, 12}) {
    const test::Edit other = test::bending(mesh.vertices, static_cast<int>(each));
    const Points got = Editor(prepared, other.handles, test::editing_network())
                           .solve(other.targets, {.stiffness = 1.0})
                           .vertices;
    EXPECT_EQ(flipped_faces(mesh.vertices, mesh.faces, got), 0) << each;
  }
}

// Hands pushed into the body, on few passes: a few more are made where faces are turned over still.
TEST_F(Stiffness, SomeMorePassesWhereFacesAreTurnedOver) {
  constexpr int kPasses = 24;
  int more = 0;
  for (uint64_t seed = 1; seed <= 8; ++seed) {
    const Eigen::RowVector3d hand = mesh.vertices.colwise().maxCoeff(),
                             middle = mesh.vertices.colwise().mean();
    const Matrix3 turn = test::rotation(seed);
    const std::vector<HandleTarget> targets = {
        {}, {.matrix = test::affine(turn, 0.5 * (hand + middle) - hand * turn), .positions = {}}};
    const EditResult got = editor->solve(targets, {.stiffness = 1.0, .passes = kPasses});
    EXPECT_EQ(flipped_faces(mesh.vertices, mesh.faces, got.vertices), 0) << seed;
    EXPECT_LE(got.report.passes, 2 * kPasses);
    more += got.report.passes > kPasses ? 1 : 0;
  }
  EXPECT_GT(more, 0);
}

TEST_F(Stiffness, ArapReachesLessOfItsEnergyThanTheSlider) {
  const double least = arap({.method = EditMethod::arap});
  for (const double stiffness : {0.0, 0.5, 1.0}) {
    EXPECT_LT(least, arap({.stiffness = stiffness})) << stiffness;
  }
  // Its minimum: as many passes again win next to nothing.
  EXPECT_LT(least - arap({.method = EditMethod::arap, .passes = 400}), 1e-3 * least);
}

TEST_F(Stiffness, ArapDoesNotAskTheNetworkOrTheSlider) {
  const Points expected = Editor(prepared, edit.handles, nullptr)
                              .solve(edit.targets, {.method = EditMethod::arap})
                              .vertices;
  EXPECT_EQ(editor->solve(edit.targets, {.method = EditMethod::arap}).vertices, expected);
  EXPECT_EQ(editor->solve(edit.targets, {.method = EditMethod::arap, .stiffness = 0.7}).vertices,
            expected);
}

TEST_F(Stiffness, PassesEndWhereTheyHaveConverged) {
  for (const EditOptions& options : {EditOptions{.stiffness = 1.0, .passes = 5000},
                                     EditOptions{.method = EditMethod::arap, .passes = 5000}}) {
    const EditReport report = editor->solve(edit.targets, options).report;
    EXPECT_GT(report.passes, 5);
    EXPECT_LT(report.passes, 5000);
  }
}

TEST_F(Stiffness, TheSliderHasNoJumps) {
  // Between neighbours at most two passes more, the first of which go farthest.
  const double size = test::diagonal(mesh.vertices);
  Points before = editor->solve(edit.targets).vertices;
  for (double stiffness = 0.02; stiffness < 0.3; stiffness += 0.02) {
    const Points now = editor->solve(edit.targets, {.stiffness = stiffness}).vertices;
    EXPECT_LT(test::farthest(now, before), 0.1 * size) << stiffness;
    before = now;
  }
}

TEST_F(Stiffness, AnIdentityInPlaceOfTheNetworkChangesNatural) {
  const Editor without(prepared, edit.handles, nullptr);
  for (const double stiffness : {0.0, 0.3}) {
    EXPECT_GT(test::farthest(editor->solve(edit.targets, {.stiffness = stiffness}).vertices,
                             without.solve(edit.targets, {.stiffness = stiffness}).vertices),
              1e-3 * test::diagonal(mesh.vertices));
  }
}

TEST_F(Stiffness, PolishAndNetworkRoundsMatter) {
  const double size = test::diagonal(mesh.vertices);
  const Points usual = editor->solve(edit.targets).vertices;
  EXPECT_GT(test::farthest(editor->solve(edit.targets, {.polish = 0}).vertices, usual),
            1e-4 * size);
  EXPECT_GT(test::farthest(editor->solve(edit.targets, {.network_rounds = 2}).vertices, usual),
            1e-4 * size);
  // More of them than rounds: all.
  EXPECT_EQ(editor->solve(edit.targets, {.network_rounds = 9}).vertices,
            editor->solve(edit.targets, {.network_rounds = 2}).vertices);
  const EditResult none = editor->solve(edit.targets, {.network_rounds = 0});
  EXPECT_FALSE(none.report.network);
  EXPECT_EQ(none.vertices, editor->solve(edit.targets, {.network = false}).vertices);
}

}  // namespace
}  // namespace supple
