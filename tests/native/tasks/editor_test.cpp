// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Geometry>
#include <thread>

#include "native/tasks/editing.h"
#include "supple/tasks/metrics.h"

namespace supple {
namespace {

TEST(Editor, HandleVerticesAreExactlyOnTheirTargets) {
  const zoo::Mesh mesh = zoo::with_unused_vertices(zoo::perturbed_sphere(2, 4));
  const auto prepared = test::prepared(mesh);
  // Vertex 0 belongs to no face and is a handle's all the same.
  const std::vector<Handle> handles = {{"held", Eigen::Vector3i(0, 7, 12)},
                                       {"free", Eigen::Vector2i(100, 90)},
                                       {"turned", Eigen::Vector2i(50, 44)}};
  const Points free = test::noise(2, 3, 1);
  const Eigen::Matrix4d matrix = test::affine(test::rotation(2), {0.3, 0.1, -0.2});
  const Editor editor(prepared, handles, test::editing_network());
  for (const auto& [name, options] : test::kinds()) {
    const Points got =
        editor
            .solve({{}, {.matrix = {}, .positions = free}, {.matrix = matrix, .positions = {}}},
                   options)
            .vertices;
    ASSERT_EQ(got.rows(), mesh.vertices.rows());
    EXPECT_TRUE(got.allFinite()) << name;
    for (const int i : handles[0].vertices) {
      EXPECT_EQ(got.row(i), mesh.vertices.row(i)) << name;
    }
    for (int i = 0; i < 2; ++i) {
      EXPECT_EQ(got.row(handles[1].vertices[i]), free.row(i));
      const Eigen::Vector4d rest =
          mesh.vertices.row(handles[2].vertices[i]).transpose().homogeneous();
      EXPECT_LT((got.row(handles[2].vertices[i]).transpose() - (matrix * rest).head<3>()).norm(),
                1e-14);
    }
  }
}

class EditorZoo : public ::testing::TestWithParam<zoo::Entry> {};

TEST_P(EditorZoo, ABendStaysFiniteAndNearTheMesh) {
  const zoo::Mesh& mesh = GetParam().mesh;
  const test::Edit edit = test::bending(mesh.vertices, mesh.vertices.rows() < 12 ? 1 : 4);
  const Editor editor(test::prepared(mesh), edit.handles, test::editing_network());
  for (const auto& [name, options] : test::kinds()) {
    const Points got = editor.solve(edit.targets, options).vertices;
    ASSERT_EQ(got.rows(), mesh.vertices.rows());
    ASSERT_TRUE(got.allFinite()) << name;
    EXPECT_LT(test::diagonal(got), 4.0 * test::diagonal(mesh.vertices)) << name;
  }
}

SUPPLE_OVER_THE_ZOO(EditorZoo);

class BendingEditor : public ::testing::Test {
 protected:
  zoo::Mesh mesh = zoo::square_tower(3, 9);
  test::Edit edit = test::bending(mesh.vertices);
  std::shared_ptr<const PreparedMesh> prepared = test::prepared(mesh);
  std::shared_ptr<const LocalJacobianNetwork<float>> network = test::editing_network();
};

TEST_F(BendingEditor, ReportsWhatWasDone) {
  const Editor editor(prepared, edit.handles, network);
  EditReport report = editor.solve(edit.targets, {.rounds = 2, .passes = 7}).report;
  EXPECT_EQ(report.rounds, 2);
  EXPECT_EQ(report.polish, 1);
  EXPECT_EQ(report.passes, 0);
  EXPECT_TRUE(report.network);
  EXPECT_GE(report.total_milliseconds, report.rounds_milliseconds);
  report = editor.solve(edit.targets, {.stiffness = 1.0, .passes = 7, .network = false}).report;
  EXPECT_EQ(report.passes, 7);
  EXPECT_FALSE(report.network);
  report = editor.solve(edit.targets, {.stiffness = 0.5, .polish = 3, .passes = 20}).report;
  EXPECT_EQ(report.polish, 3);
  EXPECT_EQ(report.passes, 5);  // the square of the stiffness
  EXPECT_TRUE(report.network);
  report = editor.solve(edit.targets, {.method = EditMethod::arap, .passes = 4}).report;
  EXPECT_EQ(report.polish, 0);
  EXPECT_EQ(report.passes, 4);
  EXPECT_FALSE(report.network);
  EXPECT_FALSE(Editor(prepared, edit.handles, nullptr).solve(edit.targets).report.network);
}

TEST_F(BendingEditor, TheNetworkOptionSwitchesTheNetwork) {
  const Editor with(prepared, edit.handles, network), without(prepared, edit.handles, nullptr);
  const Points off = with.solve(edit.targets, {.network = false}).vertices;
  EXPECT_EQ(off, without.solve(edit.targets).vertices);
  EXPECT_GT(test::farthest(with.solve(edit.targets).vertices, off), 1e-4);
}

TEST_F(BendingEditor, AnUntrainedNetworkIsNearlyTheIdentity) {
  const auto fresh = std::make_shared<LocalJacobianNetwork<float>>(
      Architecture{.eigenfunctions = 32, .width = 64}, 1);
  const Points a = Editor(prepared, edit.handles, fresh).solve(edit.targets).vertices;
  const Points b = Editor(prepared, edit.handles, nullptr).solve(edit.targets).vertices;
  EXPECT_LT(test::farthest(a, b), 0.02 * test::diagonal(mesh.vertices));
}

TEST_F(BendingEditor, StiffDistortsLessThanNaturalAndMorePassesLess) {
  const Editor editor(prepared, edit.handles, nullptr);
  const auto distortion = [&](const EditOptions& options) {
    return symmetric_dirichlet(mesh.vertices, mesh.faces,
                               editor.solve(edit.targets, options).vertices);
  };
  const double natural = distortion({});
  const double few = distortion({.stiffness = 1.0, .passes = 5});
  const double many = distortion({.stiffness = 1.0, .passes = 60});
  EXPECT_LT(few, natural);
  EXPECT_LT(many, few);
}

TEST_F(BendingEditor, NoRoundsIsTheSmoothSuggestion) {
  const Editor editor(prepared, edit.handles, network);
  const Points got = editor.solve(edit.targets, {.rounds = 0}).vertices;
  EXPECT_TRUE(got.allFinite());
  EXPECT_EQ(got, editor.solve(edit.targets, {.rounds = 0, .network = false}).vertices);
}

TEST_F(BendingEditor, APaperNetworkEdits) {
  const auto paper = test::editing_network(32, Configuration::paper);
  const Points got = Editor(prepared, edit.handles, paper).solve(edit.targets).vertices;
  EXPECT_TRUE(got.allFinite());
}

TEST_F(BendingEditor, ANetworkWithFewerEigenfunctionsThanWerePrepared) {
  const auto small = test::editing_network(12);
  const Points got = Editor(prepared, edit.handles, small).solve(edit.targets).vertices;
  EXPECT_TRUE(got.allFinite());
  EXPECT_GT(
      test::farthest(got, Editor(prepared, edit.handles, nullptr).solve(edit.targets).vertices),
      1e-5);
}

TEST_F(BendingEditor, AnotherOrderOfHandlesIsTheSameEdit) {
  const Editor a(prepared, edit.handles, network);
  const Editor b(prepared, {edit.handles[1], edit.handles[0]}, network);
  EXPECT_LT(test::farthest(a.solve(edit.targets).vertices,
                           b.solve({edit.targets[1], edit.targets[0]}).vertices),
            1e-6 * test::diagonal(mesh.vertices));
}

TEST_F(BendingEditor, ProgressEndsAtOne) {
  Progress progress;
  const Editor editor(prepared, edit.handles, network);
  editor.solve(edit.targets, {.stiffness = 1.0}, ProgressRange(&progress));
  EXPECT_DOUBLE_EQ(progress.fraction(), 1.0);
}

TEST_F(BendingEditor, SameBytesEveryTime) {
  const Points a = Editor(prepared, edit.handles, network).solve(edit.targets).vertices;
  const Points b = Editor(test::prepared(mesh), edit.handles, network).solve(edit.targets).vertices;
  EXPECT_EQ(a, b);
}

TEST_F(BendingEditor, SeveralThreadsGiveTheSameBytes) {
  const Editor editor(prepared, edit.handles, network);
  std::vector<std::vector<HandleTarget>> targets(4, edit.targets);
  std::vector<Points> expected, results(4);
  for (size_t t = 0; t < targets.size(); ++t) {
    (*targets[t][1].matrix)(0, 3) += 0.1 * static_cast<double>(t);
    expected.push_back(editor.solve(targets[t], {.stiffness = 1.0, .passes = 3}).vertices);
  }
  std::vector<std::thread> threads;
  for (size_t t = 0; t < targets.size(); ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < 3; ++i) {
        results[t] = editor.solve(targets[t], {.stiffness = 1.0, .passes = 3}).vertices;
      }
    });
  }
  for (auto& thread : threads) {
    thread.join();
  }
  for (size_t t = 0; t < targets.size(); ++t) {
    EXPECT_EQ(results[t], expected[t]) << "thread " << t;
  }
}

class LooseEditor : public ::testing::Test {
 protected:
  // Handles on the first sphere only.
  void SetUp() override {
    edit = test::bending(zoo::icosphere(2).vertices);
    prepared = test::prepared(mesh);
  }
  Points loose(const Points& points) const { return points.bottomRows(162); }
  zoo::Mesh mesh = zoo::two_spheres(2);
  test::Edit edit;
  std::shared_ptr<const PreparedMesh> prepared;
};

TEST_F(LooseEditor, FollowMovesThemRigidly) {
  const Points got = Editor(prepared, edit.handles, nullptr).solve(edit.targets).vertices;
  EXPECT_GT(test::farthest(loose(got), loose(mesh.vertices)), 0.1);
  // All distances within the piece are kept.
  const Points rest = loose(mesh.vertices), moved = loose(got);
  for (Eigen::Index i = 1; i < rest.rows(); ++i) {
    EXPECT_NEAR((moved.row(i) - moved.row(0)).norm(), (rest.row(i) - rest.row(0)).norm(), 1e-12);
  }
}

TEST_F(LooseEditor, FollowKeepsThePlaceNextToTheNearestPoint) {
  // The nearest points of the two spheres, (1, 0, 0) and (2, 0, 0), stay as far apart.
  const Points got = Editor(prepared, edit.handles, nullptr).solve(edit.targets).vertices;
  Eigen::Index a = 0, b = 0;
  mesh.vertices.topRows(162).col(0).maxCoeff(&a);
  loose(mesh.vertices).col(0).minCoeff(&b);
  const double rest = (mesh.vertices.row(a) - mesh.vertices.row(162 + b)).norm();
  EXPECT_NEAR((got.row(a) - got.row(162 + b)).norm(), rest, 0.05);
}

TEST_F(LooseEditor, StayLeavesThem) {
  const Points got = Editor(prepared, edit.handles, nullptr)
                         .solve(edit.targets, {.loose_pieces = LoosePieces::stay})
                         .vertices;
  EXPECT_LT(test::farthest(loose(got), loose(mesh.vertices)), 1e-12);
}

}  // namespace
}  // namespace supple
