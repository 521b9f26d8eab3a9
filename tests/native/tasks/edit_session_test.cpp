// SPDX-License-Identifier: GPL-3.0-or-later
#include "native/tasks/editing.h"
#include "supple/core/parallel.h"

namespace supple {
namespace {

class Session : public ::testing::Test {
 protected:
  Points solved(const std::vector<HandleTarget>& targets, const EditOptions& options) const {
    return editor->solve(targets, options).vertices;
  }
  // Far more calls than there are steps.
  static Points finish(EditSession& session, double milliseconds) {
    Points got = session.advance(milliseconds).vertices;
    for (int call = 0; call < 500 && !session.settled(); ++call) {
      got = session.advance(milliseconds).vertices;
    }
    EXPECT_TRUE(session.settled());
    return got;
  }
  std::vector<HandleTarget> other() const {
    std::vector<HandleTarget> targets = edit.targets;
    (*targets[1].matrix)(0, 3) += 0.4;
    return targets;
  }

  zoo::Mesh mesh = zoo::square_tower(3, 9);
  test::Edit edit = test::bending(mesh.vertices);
  std::shared_ptr<const Editor> editor =
      std::make_shared<Editor>(test::prepared(mesh), edit.handles, test::editing_network());
};

TEST_F(Session, EndsWhereSolveDoesWhateverTheBudget) {
  for (const auto& [name, options] : test::kinds()) {
    const Points expected = solved(edit.targets, options);
    for (const double milliseconds : {0.0, 1e-9, 0.3, 1e9}) {
      EditSession session(editor, options);
      session.aim(edit.targets);
      EXPECT_EQ(finish(session, milliseconds), expected) << name << ", " << milliseconds << " ms";
      EXPECT_EQ(session.advance(milliseconds).vertices, expected) << name << ", settled";
    }
  }
}

TEST_F(Session, ReportsWhatSolveReports) {
  for (const auto& [name, options] : test::kinds()) {
    const EditReport expected = editor->solve(edit.targets, options).report;
    EditSession session(editor, options);
    session.aim(edit.targets);
    finish(session, 0.0);
    const EditReport got = session.advance(0.0).report;
    EXPECT_EQ(got.rounds, expected.rounds) << name;
    EXPECT_EQ(got.polish, expected.polish) << name;
    EXPECT_EQ(got.passes, expected.passes) << name;
    EXPECT_EQ(got.network, expected.network) << name;
  }
}

TEST_F(Session, TheFirstPoseIsUsable) {
  for (const auto& [name, options] : test::kinds()) {
    EditSession session(editor, options);
    session.aim(edit.targets);
    EXPECT_FALSE(session.settled());
    const EditResult first = session.advance(0.0);
    ASSERT_TRUE(first.vertices.allFinite()) << name;
    EXPECT_LT(test::diagonal(first.vertices), 3.0 * test::diagonal(mesh.vertices)) << name;
    EXPECT_EQ(first.report.rounds, options.rounds) << name;
    const Points end = solved(edit.targets, options);
    for (const Handle& handle : edit.handles) {
      for (const int i : handle.vertices) {
        EXPECT_EQ(first.vertices.row(i), end.row(i)) << name;
      }
    }
  }
}

TEST_F(Session, APoseOnTheWayHasItsHandlesExactly) {
  EditSession session(editor, {.stiffness = 1.0});
  session.aim(edit.targets);
  const Points end = solved(edit.targets, {.stiffness = 1.0});
  int calls = 0;
  for (; !session.settled() && calls < 500; ++calls) {
    const Points now = session.advance(0.0).vertices;
    ASSERT_TRUE(now.allFinite());
    for (const Handle& handle : edit.handles) {
      for (const int i : handle.vertices) {
        ASSERT_EQ(now.row(i), end.row(i)) << "call " << calls;
      }
    }
  }
  EXPECT_GT(calls, 5) << "no pose on the way was seen";
}

TEST_F(Session, AimingAgainBeginsAgain) {
  for (const auto& [name, options] : test::kinds()) {
    EditSession session(editor, options);
    session.aim(edit.targets);
    session.advance(0.0);
    session.aim(other());
    EXPECT_FALSE(session.settled()) << name;
    EXPECT_EQ(finish(session, 0.0), solved(other(), options)) << name << ", while at work";
    session.aim(edit.targets);
    EXPECT_FALSE(session.settled()) << name;
    EXPECT_EQ(finish(session, 0.0), solved(edit.targets, options)) << name << ", settled";
  }
}

TEST_F(Session, ManyTargetsOneAfterTheOther) {
  EditSession session(editor, {.stiffness = 0.4});
  std::vector<HandleTarget> targets = edit.targets;
  for (int frame = 0; frame < 10; ++frame) {
    (*targets[1].matrix)(1, 3) += 0.05;
    session.aim(targets);
    session.advance(0.0);
  }
  EXPECT_EQ(finish(session, 0.0), solved(targets, {.stiffness = 0.4}));
}

TEST_F(Session, AdvanceBeforeAimIsRefused) {
  EditSession session(editor, {});
  EXPECT_FALSE(session.settled());
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"aim"}, [&] { session.advance(1.0); }));
  session.aim(edit.targets);
  EXPECT_EQ(finish(session, 1.0), solved(edit.targets, {}));
}

TEST_F(Session, TargetsThatAreRefusedLeaveItAsItWas) {
  EditSession session(editor, {.stiffness = 1.0});
  session.aim(edit.targets);
  session.advance(0.0);
  std::vector<HandleTarget> bad = edit.targets;
  bad[1].matrix = Eigen::Vector4d(1, 1, 0, 1).asDiagonal();
  EXPECT_TRUE(test::fails_with(ErrorCode::singular_matrix, {"'hand'"}, [&] { session.aim(bad); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {}, [&] { session.aim({{}}); }));
  EXPECT_EQ(finish(session, 0.0), solved(edit.targets, {.stiffness = 1.0}));
}

TEST_F(Session, KeepsItsEditor) {
  EditSession session(editor, {});
  const Points expected = solved(edit.targets, {});
  editor.reset();
  session.aim(edit.targets);
  EditSession moved = std::move(session);
  EXPECT_EQ(finish(moved, 0.0), expected);
}

TEST_F(Session, ThreadsMoveTheResultByRoundingAlone) {
  const int before = thread_count();
  for (const auto& [name, options] : test::kinds()) {
    set_thread_count(1);
    const Points one = solved(edit.targets, options);
    EXPECT_EQ(solved(edit.targets, options), one) << name;
    set_thread_count(2);
    const Points two = solved(edit.targets, options);
    EXPECT_EQ(solved(edit.targets, options), two) << name;
    EXPECT_LT(test::farthest(one, two), 1e-6 * test::diagonal(mesh.vertices)) << name;
  }
  set_thread_count(before);
}

}  // namespace
}  // namespace supple
