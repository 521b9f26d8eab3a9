// SPDX-License-Identifier: GPL-3.0-or-later
#include "tasks/edit/suggestion.h"

#include <Eigen/Geometry>
#include <numbers>
#include <set>

#include "native/tasks/editing.h"
#include "supple/geometry/jacobians.h"
#include "supple/geometry/rotations.h"

namespace supple {
namespace {

Matrix3 about(const Eigen::Vector3d& axis, double angle) {
  return Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix().transpose();
}

Eigen::VectorXd ones(Eigen::Index count) { return Eigen::VectorXd::Ones(count); }

void expect_motion(const RigidMotion& motion, const Matrix3& turn, const Eigen::RowVector3d& offset,
                   double tolerance) {
  EXPECT_LT((motion.rotation - turn).norm(), tolerance);
  const Eigen::RowVector3d place(0.3, -0.2, 0.9);
  EXPECT_LT((motion(place) - (place * turn + offset)).norm(), tolerance);
}

TEST(NearestMotion, OfARigidMotionIsThatMotion) {
  const Points rest = test::noise(9, 3, 1);
  for (uint64_t which = 0; which < 8; ++which) {
    const Matrix3 turn = test::rotation(which);
    const Eigen::RowVector3d offset(1.0, -2.0, 0.5);
    expect_motion(nearest_motion(rest, (rest * turn).rowwise() + offset, ones(9), {turn}), turn,
                  offset, 1e-10);
  }
}

TEST(NearestMotion, WhatPointsLeaveOpenTheTurnsDecide) {
  // One point, and a line along the axis of the turn.
  Points line = Points::Zero(4, 3);
  line.col(2) << 0.0, 0.1, 0.5, 1.0;
  const Matrix3 turn = about({0, 0, 1}, 1.3);
  const Eigen::RowVector3d offset(0.2, 0.3, 0.4);
  expect_motion(nearest_motion(line, (line * turn).rowwise() + offset, ones(4), {turn}), turn,
                offset, 1e-10);
  const Points one = line.bottomRows(1);
  expect_motion(nearest_motion(one, (one * turn).rowwise() + offset, ones(1), {turn}), turn, offset,
                1e-10);
}

TEST(NearestMotion, WhatNothingDecidesDoesNotTurn) {
  const Points one = test::noise(1, 3, 1);
  const Points moved = one.rowwise() + Eigen::RowVector3d(1, 2, 3);
  EXPECT_LT((nearest_motion(one, moved, ones(1), {}).rotation - Matrix3::Identity()).norm(), 1e-15);
  EXPECT_LT((nearest_motion(one, moved, ones(1), {})(one.row(0)) - moved.row(0)).norm(), 1e-15);
}

TEST(NearestMotion, APointCountsAsMuchAsItsWeight) {
  const Points rest = test::noise(6, 3, 3), moved = test::noise(6, 3, 4);
  Eigen::VectorXd weights = ones(6);
  weights.tail(2).setConstant(2.0);
  Points rest_twice(8, 3), moved_twice(8, 3);
  rest_twice << rest, rest.bottomRows(2);
  moved_twice << moved, moved.bottomRows(2);
  const RigidMotion twice = nearest_motion(rest_twice, moved_twice, ones(8), {});
  const RigidMotion weighed = nearest_motion(rest, moved, weights, {});
  EXPECT_LT((weighed.rotation - twice.rotation).norm(), 1e-10);
  EXPECT_LT((weighed.to - twice.to).norm(), 1e-12);
}

TEST(RotationAround, OfAPatchThatTurnsIsItsTurn) {
  const Points rest = 0.05 * test::noise(20, 3, 2);
  for (const double angle : {0.2, 1.5, 2.9}) {
    const Matrix3 turn = about({1, 2, -1}, angle);
    const Points moved = rest * turn;
    // Right already where the rest agrees; a hundredth of doubt otherwise.
    EXPECT_LT((rotation_around(rest, moved, rest.row(3), turn) - turn).norm(), 1e-12);
    EXPECT_LT((rotation_around(rest, moved, rest.row(3), Matrix3::Identity()) - turn).norm(), 0.15)
        << angle;
  }
}

TEST(RotationAround, OfOnePointIsTheOther) {
  const Points one = test::noise(1, 3, 2);
  const Matrix3 turn = test::rotation(1);
  EXPECT_EQ(rotation_around(one, 2.0 * one, one.row(0), turn), turn);
}

TEST(FarApart, AreDistinctFewAndCoverThePoints) {
  for (const Eigen::Index count : {1, 2, 4, 5, 300, 3000}) {
    const Points points = 0.5 * test::noise(count, 3, 3);
    const std::vector<int> chosen = far_apart(points);
    EXPECT_EQ(std::set<int>(chosen.begin(), chosen.end()).size(), chosen.size());
    EXPECT_GE(chosen.size(), static_cast<size_t>(std::min<Eigen::Index>(count, 4)));
    EXPECT_LE(chosen.size(), 64u);
    if (chosen.size() < 64 && count > 4) {
      for (Eigen::Index i = 0; i < count; ++i) {
        double nearest = 1e9;
        for (const int c : chosen) {
          nearest = std::min(nearest, (points.row(i) - points.row(c)).norm());
        }
        EXPECT_LT(nearest, 0.06);
      }
    }
  }
}

TEST(FarApart, PointsOnOneAnotherAreChosenOnceEach) {
  const std::vector<int> chosen = far_apart(Points::Constant(10, 3, 0.25));
  EXPECT_EQ(chosen.size(), 4u);
  EXPECT_EQ(std::set<int>(chosen.begin(), chosen.end()).size(), 4u);
}

TEST(InterpolatedTurns, MeetThoseGiven) {
  const SurfaceOperators operators{
      TriangleMesh(zoo::icosphere(3).vertices, zoo::icosphere(3).faces)};
  const auto base = std::make_shared<const PinnedLaplacian>(
      operators.laplacian, operators.mass, operators.component, operators.component_count);
  const BiharmonicInterpolation interpolation(base, Eigen::Vector3i(0, 200, 600));
  const std::vector<Matrix3> given = {test::rotation(0), about({0, 0, 1}, 0.4), test::rotation(2)};
  for (const Matrix3& whole : {Matrix3(Matrix3::Identity()), test::rotation(5)}) {
    const auto rotation_at = [&](const RowMatrix<double>& turns, Eigen::Index v) -> Matrix3 {
      return whole * rotation_matrix(Eigen::RowVector3d(turns.row(v)));
    };
    const RowMatrix<double> turns = interpolated_turns(interpolation, given, whole);
    ASSERT_EQ(turns.rows(), operators.vertices.rows());
    for (int p = 0; p < 3; ++p) {
      EXPECT_LT(
          (rotation_at(turns, interpolation.points()[p]) - given[static_cast<size_t>(p)]).norm(),
          1e-6);
    }
    const std::vector<Matrix3> same(3, given[0]);
    const RowMatrix<double> all = interpolated_turns(interpolation, same, whole);
    for (Eigen::Index v = 0; v < all.rows(); ++v) {
      ASSERT_LT((rotation_at(all, v) - given[0]).norm(), 1e-12);
    }
  }
}

// --- what handles may ask -----------------------------------------------------------------------

TEST(EditTargets, HoweverOddGiveAFinitePose) {
  const zoo::Mesh mesh = zoo::square_tower(3, 9);
  const test::Edit edit = test::bending(mesh.vertices);
  const Editor editor(test::prepared(mesh), edit.handles, test::editing_network());
  const Eigen::Index count = edit.handles[1].vertices.size();
  const double pi = std::numbers::pi;
  std::vector<HandleTarget> odd(7);
  odd[0].matrix = Eigen::Vector4d(-1, 1, 1, 1).asDiagonal();  // mirrored
  odd[1].matrix = Eigen::Vector4d(-1, -1, -1, 1).asDiagonal();
  odd[2].matrix = test::affine(about({0, 0, 1}, pi), {0, 0, 0});
  odd[3].matrix = Eigen::Vector4d(1e-3, 1e-3, 1e-3, 1).asDiagonal();
  odd[4].matrix = Eigen::Vector4d(30, 0.1, 2, 1).asDiagonal();
  odd[5].positions = Points::Constant(count, 3, 0.5);  // all in one place
  odd[6].positions = Points(test::noise(count, 1, 1) * Eigen::RowVector3d(1, 2, 3));  // a line
  for (const auto& [name, options] : test::kinds(10)) {
    for (size_t i = 0; i < odd.size(); ++i) {
      EXPECT_TRUE(editor.solve({{}, odd[i]}, options).vertices.allFinite()) << name << ", " << i;
    }
  }
}

TEST(EditTargets, OneHandleOnMorePiecesThanItHasGuides) {
  const zoo::Mesh mesh = zoo::many_pieces(90);
  const int step = static_cast<int>(mesh.vertices.rows()) / 90;
  const Handle all{"all", Eigen::VectorXi::LinSpaced(90, 0, 89 * step)};
  const Editor editor(test::prepared(mesh), {all}, nullptr);
  const Matrix3 turn = test::rotation(3);
  const double size = test::diagonal(mesh.vertices);
  for (const auto& [name, options] : test::kinds(5)) {
    const Points got =
        editor.solve({{.matrix = test::affine(turn, {1, 2, 3}), .positions = {}}}, options)
            .vertices;
    const Points expected = (mesh.vertices * turn).rowwise() + Eigen::RowVector3d(1, 2, 3);
    EXPECT_LT(test::farthest(got, expected), 1e-9 * size) << name;
  }
}

}  // namespace
}  // namespace supple
