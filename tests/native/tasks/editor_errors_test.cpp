// SPDX-License-Identifier: GPL-3.0-or-later
// Everything an editor refuses, and that the message names the culprit.
#include <limits>

#include "native/tasks/editing.h"

namespace supple {
namespace {

Eigen::VectorXi indices(std::initializer_list<int> values) {
  return Eigen::VectorXi::Map(values.begin(), static_cast<Eigen::Index>(values.size()));
}

class EditorErrors : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { mesh_ = test::prepared(zoo::icosphere(1), 20); }
  static void TearDownTestSuite() { mesh_.reset(); }

  ::testing::AssertionResult binding_fails(ErrorCode code,
                                           std::initializer_list<const char*> parts) {
    return test::fails_with(code, parts, [this] { Editor(mesh_, handles, network); });
  }
  ::testing::AssertionResult solving_fails(ErrorCode code,
                                           std::initializer_list<const char*> parts) {
    const Editor editor(mesh_, handles, network);
    return test::fails_with(code, parts, [&] { editor.solve(targets, options); });
  }

  std::vector<Handle> handles = {{"foot", indices({0, 1, 2})}, {"hand", indices({5, 6})}};
  std::vector<HandleTarget> targets{2};
  std::shared_ptr<const LocalJacobianNetwork<float>> network;
  EditOptions options;
  static std::shared_ptr<const PreparedMesh> mesh_;
};
std::shared_ptr<const PreparedMesh> EditorErrors::mesh_;

TEST_F(EditorErrors, NoHandles) {
  handles.clear();
  EXPECT_TRUE(binding_fails(ErrorCode::no_handles, {"no handles"}));
}

TEST_F(EditorErrors, AnEmptyHandle) {
  handles[1].vertices.resize(0);
  EXPECT_TRUE(binding_fails(ErrorCode::empty_handle, {"'hand'"}));
}

TEST_F(EditorErrors, AnIndexOutOfRange) {
  handles[1].vertices = indices({5, 42});
  EXPECT_TRUE(binding_fails(ErrorCode::index_out_of_range, {"'hand'", "42", "42 vertices"}));
  handles[1].vertices = indices({-1});
  EXPECT_TRUE(binding_fails(ErrorCode::index_out_of_range, {"'hand'", "-1"}));
}

TEST_F(EditorErrors, AVertexInTwoHandles) {
  handles[1].vertices = indices({5, 2});
  EXPECT_TRUE(binding_fails(ErrorCode::overlapping_handles, {"Vertex 2", "'foot'", "'hand'"}));
}

TEST_F(EditorErrors, AVertexTwiceInOneHandle) {
  handles[1].vertices = indices({5, 6, 5});
  EXPECT_TRUE(binding_fails(ErrorCode::overlapping_handles, {"'hand'", "5", "twice"}));
}

TEST_F(EditorErrors, AWeightThatIsNone) {
  for (const double weight : {0.0, -0.5, 1.5, std::numeric_limits<double>::quiet_NaN()}) {
    handles[1].weight = weight;
    EXPECT_TRUE(binding_fails(ErrorCode::bad_option, {"'hand'", "weight", "at most 1"}));
  }
}

TEST_F(EditorErrors, OnlyVerticesWithoutFaces) {
  mesh_ = test::prepared(zoo::with_unused_vertices(zoo::icosphere(1)), 20);
  handles = {{"dust", indices({0})}};
  EXPECT_TRUE(binding_fails(ErrorCode::no_handles, {"face"}));
  SetUpTestSuite();
}

TEST_F(EditorErrors, ANetworkOfTheOtherSignal) {
  network = std::make_shared<LocalJacobianNetwork<float>>(
      Architecture{.signal = SignalKind::spectral, .eigenfunctions = 20, .width = 8}, 1);
  EXPECT_TRUE(binding_fails(ErrorCode::bad_option, {"spectral", "rotations"}));
}

TEST_F(EditorErrors, AnotherNumberOfTargets) {
  targets.resize(1);
  EXPECT_TRUE(solving_fails(ErrorCode::wrong_shape, {"2 handles", "1 targets"}));
}

TEST_F(EditorErrors, AMatrixAndPositions) {
  targets[1] = {.matrix = Eigen::Matrix4d::Identity(), .positions = Points::Zero(2, 3)};
  EXPECT_TRUE(solving_fails(ErrorCode::bad_option, {"'hand'", "matrix", "positions"}));
}

TEST_F(EditorErrors, AMatrixThatIsNotFinite) {
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    targets[1].matrix = Eigen::Matrix4d::Identity();
    (*targets[1].matrix)(0, 3) = bad;
    EXPECT_TRUE(solving_fails(ErrorCode::not_finite, {"'hand'"}));
  }
}

TEST_F(EditorErrors, AMatrixWithoutAnInverse) {
  targets[1].matrix = Eigen::Vector4d(1, 1, 0, 1).asDiagonal();
  EXPECT_TRUE(solving_fails(ErrorCode::singular_matrix, {"'hand'"}));
  targets[1].matrix = Eigen::Vector4d(0, 0, 0, 1).asDiagonal();
  EXPECT_TRUE(solving_fails(ErrorCode::singular_matrix, {"'hand'"}));
}

TEST_F(EditorErrors, AMatrixThatIsNotAffine) {
  targets[1].matrix = Eigen::Matrix4d::Identity();
  (*targets[1].matrix)(3, 0) = 0.5;  // a translation in the wrong place
  EXPECT_TRUE(solving_fails(ErrorCode::bad_option, {"'hand'", "last row"}));
}

TEST_F(EditorErrors, AnotherNumberOfPositions) {
  targets[0].positions = Points::Zero(2, 3);
  EXPECT_TRUE(solving_fails(ErrorCode::wrong_shape, {"'foot'", "3 vertices", "2 target"}));
}

TEST_F(EditorErrors, APositionThatIsNotFinite) {
  targets[0].positions = Points::Zero(3, 3);
  (*targets[0].positions)(1, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(solving_fails(ErrorCode::not_finite, {"'foot'"}));
}

TEST_F(EditorErrors, NegativeRoundsOrPasses) {
  for (const EditOptions& bad : {EditOptions{.rounds = -1}, EditOptions{.network_rounds = -1},
                                 EditOptions{.polish = -1}, EditOptions{.passes = -1}}) {
    options = bad;
    EXPECT_TRUE(solving_fails(ErrorCode::bad_option, {"Rounds", "passes"}));
  }
}

TEST_F(EditorErrors, AStiffnessOutOfRange) {
  for (const double bad : {-1e-9, 1.0 + 1e-9, std::numeric_limits<double>::quiet_NaN()}) {
    options.stiffness = bad;
    EXPECT_TRUE(solving_fails(ErrorCode::bad_option, {"stiffness", "0 (natural)", "1 (stiff)"}));
    const auto editor = std::make_shared<const Editor>(mesh_, handles, nullptr);
    EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"stiffness"},
                                 [&] { EditSession(editor, options); }));
  }
}

TEST_F(EditorErrors, CancelledBeforeAndWhileSolving) {
  const Editor editor(mesh_, handles, nullptr);
  Progress progress;
  progress.cancel();
  EXPECT_TRUE(test::fails_with(ErrorCode::cancelled, {}, [&] {
    editor.solve(targets, {.stiffness = 1.0}, ProgressRange(&progress));
  }));
  EXPECT_TRUE(test::fails_with(ErrorCode::cancelled, {},
                               [&] { Editor(mesh_, handles, nullptr, ProgressRange(&progress)); }));
}

TEST_F(EditorErrors, AnEditorWorksOnAfterAFailedSolve) {
  const Editor editor(mesh_, handles, nullptr);
  const Points before = editor.solve(targets).vertices;
  targets[1].matrix = Eigen::Vector4d(0, 0, 0, 1).asDiagonal();
  EXPECT_THROW(editor.solve(targets), Error);
  targets[1].matrix.reset();
  EXPECT_EQ(editor.solve(targets).vertices, before);
}

TEST(EditMethods, AreFoundByName) {
  EXPECT_EQ(edit_method("supple"), EditMethod::supple);
  EXPECT_EQ(edit_method("arap"), EditMethod::arap);
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"'soft'", "'supple'", "'arap'"},
                               [] { edit_method("soft"); }));
}

TEST(PreparedMeshErrors, OptionsOutOfRange) {
  const zoo::Mesh mesh = zoo::cube();
  for (const PrepareOptions options :
       {PrepareOptions{.eigenfunctions = 0}, PrepareOptions{.eigenfunctions = -5},
        PrepareOptions{.samples = -1}}) {
    EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {},
                                 [&] { PreparedMesh(mesh.vertices, mesh.faces, options); }));
  }
}

TEST(PreparedMeshErrors, ThoseOfTheMesh) {
  zoo::Mesh mesh = zoo::cube();
  mesh.faces(0, 0) = 99;
  EXPECT_TRUE(test::fails_with(ErrorCode::index_out_of_range, {"Face 0", "99"},
                               [&] { PreparedMesh(mesh.vertices, mesh.faces); }));
}

TEST(PreparedMeshErrors, Cancelled) {
  const zoo::Mesh mesh = zoo::icosphere(3);
  Progress progress;
  progress.cancel();
  EXPECT_TRUE(test::fails_with(ErrorCode::cancelled, {}, [&] {
    PreparedMesh(mesh.vertices, mesh.faces, {.eigenfunctions = 20}, ProgressRange(&progress));
  }));
}

}  // namespace
}  // namespace supple
