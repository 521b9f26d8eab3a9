// SPDX-License-Identifier: GPL-3.0-or-later
// Handles of a weight below 1: they pull, and the mesh resists.
#include "tasks/edit/soft_handles.h"

#include <Eigen/Geometry>

#include "native/gradient_check.h"
#include "native/tasks/editing.h"

namespace supple {
namespace {

class SoftHandlesTest : public ::testing::Test {
 protected:
  Points posed(double weight, const EditOptions& options = {}) const {
    std::vector<Handle> handles = edit.handles;
    handles[1].weight = weight;
    return Editor(prepared, handles, network).solve(edit.targets, options).vertices;
  }
  // Mean distance of the second handle from where it is asked to be, in diagonals.
  double behind(const Points& points) const {
    const Eigen::VectorXi& vertices = edit.handles[1].vertices;
    const Eigen::Matrix4d& matrix = *edit.targets[1].matrix;
    double sum = 0.0;
    for (const int v : vertices) {
      const Eigen::Vector3d goal = matrix.topLeftCorner<3, 3>() * mesh.vertices.row(v).transpose() +
                                   matrix.topRightCorner<3, 1>();
      sum += (points.row(v).transpose() - goal).norm();
    }
    return sum / static_cast<double>(vertices.size()) / test::diagonal(mesh.vertices);
  }

  zoo::Mesh mesh = zoo::perturbed_sphere(3, 3);
  std::shared_ptr<const PreparedMesh> prepared = test::prepared(mesh);
  std::shared_ptr<const LocalJacobianNetwork<float>> network = test::editing_network();
  test::Edit edit = test::bending(mesh.vertices, 12);
};

TEST_F(SoftHandlesTest, TheMoreWeightTheNearerFromNotAtAllToExactly) {
  for (const auto& [name, options] : test::kinds(40)) {
    const Points hard = posed(1.0, options);
    EXPECT_LT(behind(hard), 1e-12) << name;
    double last = behind(posed(1e-6, options));
    EXPECT_GT(last, 0.1) << name;  // it is left behind
    for (const double weight : {0.1, 0.5, 0.9, 0.99}) {
      const double now = behind(posed(weight, options));
      EXPECT_LT(now, last) << name << ", weight " << weight;
      last = now;
    }
    EXPECT_LT(test::farthest(posed(1.0 - 1e-7, options), hard),
              1e-3 * test::diagonal(mesh.vertices))
        << name;
  }
}

TEST_F(SoftHandlesTest, HalfTheWeightIsAVisiblePart) {
  const double half = behind(posed(0.5)), none = behind(posed(1e-6));
  EXPECT_GT(half, 0.1 * none);
  EXPECT_LT(half, 0.8 * none);
}

TEST_F(SoftHandlesTest, NextToNoWeightIsNoHandle) {
  for (const auto& [name, options] : test::kinds(40)) {
    const Editor without(prepared, {edit.handles[0]}, network);
    const Points expected = without.solve({edit.targets[0]}, options).vertices;
    EXPECT_LT(test::farthest(posed(1e-7, options), expected), 1e-4 * test::diagonal(mesh.vertices))
        << name;
  }
}

TEST_F(SoftHandlesTest, SoftHandlesAloneMakeARigidMotionExactly) {
  std::vector<Handle> handles = edit.handles;
  handles[0].weight = 0.3;
  handles[1].weight = 0.8;
  const Matrix3 turn = test::rotation(3);
  const double size = test::diagonal(mesh.vertices);
  const Eigen::RowVector3d offset = size * Eigen::RowVector3d(0.4, -0.9, 0.2);
  const HandleTarget target{.matrix = test::affine(turn, offset), .positions = {}};
  const Editor editor(prepared, handles, network);
  for (const auto& [name, options] : test::kinds(5)) {
    const Points got = editor.solve({target, target}, options).vertices;
    EXPECT_LT(test::farthest(got, (mesh.vertices * turn).rowwise() + offset), 1e-9 * size) << name;
  }
}

// Where ARAP has converged, its gradient and the pulls cancel at every vertex that is not held.
TEST_F(SoftHandlesTest, ArapEndsWhereItsForceAndThePullAreEqual) {
  edit.handles[1].weight = 0.5;
  const EditOptions options{.method = EditMethod::arap, .passes = 2000};
  const Points posed =
      Editor(prepared, edit.handles, nullptr).solve(edit.targets, options).vertices;
  const TriangleMesh& triangles = prepared->mesh;
  const Points moved = triangles.to_surface(posed);
  Points force;
  ArapEnergy(prepared->operators).evaluate(moved, force);
  for (const int v : edit.handles[0].vertices) {
    force.row(v).setZero();
  }
  const double uncompensated = force.norm();
  const Eigen::VectorXi& pulled = edit.handles[1].vertices;
  double mass = 0.0;
  for (const int v : pulled) {
    mass += prepared->operators.mass[v];
  }
  for (const int v : pulled) {
    const Eigen::Vector3d goal =
        (*edit.targets[1].matrix * mesh.vertices.row(v).transpose().homogeneous()).head<3>();
    const Points surface_goal = triangles.to_surface(Points(goal.transpose()));
    // ARAP's energy is without the half of the Poisson equation's.
    force.row(v) += 2.0 * pull_of(0.5) * prepared->operators.mass[v] / mass *
                    (moved.row(v) - surface_goal.row(0));
  }
  EXPECT_GT(uncompensated, 0.05);
  EXPECT_LT(force.norm(), 5e-3 * uncompensated);
}

TEST_F(SoftHandlesTest, ThePulledEnergyHasAGradient) {
  const SurfaceOperators& operators = prepared->operators;
  Eigen::VectorXi vertices(3);
  vertices << 3, 50, 77;
  SoftHandles soft{vertices, vertices, Eigen::Vector3d(0.5, 2.0, 1.0)};
  const StiffEnergy inner(operators);
  const Points targets = test::noise(3, 3, 5);
  const PulledEnergy energy(inner, soft, targets);
  Points moved = test::bent(operators.vertices), gradient, other;
  EXPECT_GT(energy.evaluate(moved, gradient), inner.evaluate(moved, other) + 0.1);
  EXPECT_TRUE(test::gradient_matches([&] { return energy.evaluate(moved, other); },
                                     test::values_of(moved),
                                     test::values_of(std::as_const(gradient))));
}

TEST_F(SoftHandlesTest, OtherWeightsOnAFormerEditorAreBoundAnew) {
  const Editor hard(prepared, edit.handles, network);
  edit.handles[1].weight = 0.4;
  const Editor fresh(prepared, edit.handles, network);
  const Editor rebound(prepared, edit.handles, network, {}, &hard);
  EXPECT_EQ(rebound.solve(edit.targets).vertices, fresh.solve(edit.targets).vertices);
  // The same soft handle beside other firm ones is taken from what is there.
  const Handle third = test::handle_at("third", mesh.vertices, mesh.vertices.row(200), 3);
  const std::vector<Handle> more = {edit.handles[0], edit.handles[1], third};
  const std::vector<HandleTarget> targets = {edit.targets[0], edit.targets[1], {}};
  const Points expected = Editor(prepared, more, network).solve(targets).vertices;
  EXPECT_LT(
      test::farthest(Editor(prepared, more, network, {}, &fresh).solve(targets).vertices, expected),
      1e-6 * test::diagonal(mesh.vertices));
}

}  // namespace
}  // namespace supple
