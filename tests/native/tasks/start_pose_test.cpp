// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/tasks/start_pose.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <limits>

#include "native/tasks/editing.h"
#include "supple/geometry/jacobians.h"

namespace supple {
namespace {

class FromAStartPose : public ::testing::Test {
 protected:
  std::shared_ptr<const StartPose> start(const Points& vertices) const {
    return std::make_shared<StartPose>(*rest, vertices);
  }
  Points solve(const std::vector<HandleTarget>& targets, const EditOptions& options,
               const Points& from) const {
    return editor->solve(targets, options, {}, start(from)).vertices;
  }
  std::vector<HandleTarget> nothing() const {
    return {{}, {.matrix = Eigen::Matrix4d::Identity(), .positions = {}}};
  }
  // targets in a world that is turned and moved: v -> v turn + offset.
  std::vector<HandleTarget> moved(std::vector<HandleTarget> targets, const Matrix3& turn,
                                  const Eigen::RowVector3d& offset) const {
    const Eigen::Matrix4d world = test::affine(turn, offset);
    for (HandleTarget& target : targets) {
      const Eigen::Matrix4d matrix = target.matrix.value_or(Eigen::Matrix4d::Identity());
      target.matrix = world * matrix * world.inverse();
    }
    return targets;
  }

  zoo::Mesh mesh = zoo::square_tower(3, 9);
  std::shared_ptr<const PreparedMesh> rest = test::prepared(mesh);
  test::Edit edit = test::bending(mesh.vertices);
  std::shared_ptr<const Editor> editor =
      std::make_shared<Editor>(rest, edit.handles, test::editing_network());
  Points bent = test::bent(mesh.vertices);
  double size = test::diagonal(mesh.vertices);
};

TEST_F(FromAStartPose, NothingAskedLeavesThePose) {
  for (const auto& [name, options] : test::kinds()) {
    EXPECT_LT(test::farthest(solve(nothing(), options, bent), bent), 2e-6 * size) << name;
  }
}

TEST_F(FromAStartPose, TheRestShapeIsNoOtherStart) {
  for (const auto& [name, options] : test::kinds(20)) {
    const Points expected = editor->solve(edit.targets, options).vertices;
    EXPECT_LT(test::farthest(solve(edit.targets, options, mesh.vertices), expected), 1e-5 * size)
        << name;
  }
}

TEST_F(FromAStartPose, AMovedRestShapeGivesTheMovedEdit) {
  const Matrix3 turn = test::rotation(2);
  const Eigen::RowVector3d offset(3.0, -2.0, 7.0);
  const Points from = (mesh.vertices * turn).rowwise() + offset;
  for (const auto& [name, options] : test::kinds(20)) {
    const Points expected =
        (editor->solve(edit.targets, options).vertices * turn).rowwise() + offset;
    const Points got = solve(moved(edit.targets, turn, offset), options, from);
    EXPECT_LT(test::farthest(got, expected), 1e-5 * size) << name;
  }
}

TEST_F(FromAStartPose, ATurnedPoseGivesTheTurnedEdit) {
  const Matrix3 turn = test::rotation(5);
  const Eigen::RowVector3d offset(-1.0, 4.0, 0.5);
  for (const auto& [name, options] : test::kinds(10)) {
    const Points expected = (solve(edit.targets, options, bent) * turn).rowwise() + offset;
    const Points got =
        solve(moved(edit.targets, turn, offset), options, (bent * turn).rowwise() + offset);
    EXPECT_LT(test::farthest(got, expected), 1e-5 * size) << name;
  }
}

TEST_F(FromAStartPose, OneMotionOfAllHandlesMovesThePoseRigidly) {
  const Matrix3 turn = test::rotation(3);
  const Eigen::RowVector3d offset(0.4, 0.1, -0.6);
  const HandleTarget all{.matrix = test::affine(turn, offset), .positions = {}};
  for (const auto& [name, options] : test::kinds()) {
    const Points expected = (bent * turn).rowwise() + offset;
    EXPECT_LT(test::farthest(solve({all, all}, options, bent), expected), 2e-6 * size) << name;
  }
}

TEST_F(FromAStartPose, HandlesAreWhereTheirMatricesTakeThePose) {
  const Points got = solve(edit.targets, {}, bent);
  for (const int v : edit.handles[0].vertices) {
    EXPECT_EQ(got.row(v), bent.row(v));
  }
  for (const int v : edit.handles[1].vertices) {
    const Eigen::Vector4d at = *edit.targets[1].matrix * bent.row(v).transpose().homogeneous();
    EXPECT_LT((got.row(v).transpose() - at.head<3>()).norm(), 1e-12 * size);
  }
}

// The rounds descend sum_f A_f |J_f - S_f Q_f|^2; at their end its gradient is 0 where nothing is
// held. Written anew, face by face.
TEST_F(FromAStartPose, SlowRoundsEndWhereTheRotatedPoseFitsBest) {
  const test::Threads use(1);  // of a mesh this small, two would wait for each other
  EditOptions options{.rounds = 10000, .polish = 0, .network = false, .keep_volume = false};
  const Points got = solve(edit.targets, options, bent);
  Points gradient = Points::Zero(got.rows(), 3);
  double scale = 0.0;
  for (Eigen::Index f = 0; f < mesh.faces.rows(); ++f) {
    const auto frame = [&](const Points& points) {
      Eigen::Matrix3d e;
      e.row(0) = points.row(mesh.faces(f, 1)) - points.row(mesh.faces(f, 0));
      e.row(1) = points.row(mesh.faces(f, 2)) - points.row(mesh.faces(f, 0));
      const Eigen::RowVector3d normal = e.row(0).cross(e.row(1));
      e.row(2) = normal.normalized();
      return e;
    };
    const Eigen::Matrix3d inverse = frame(mesh.vertices).inverse();
    const double area = 0.5 / std::abs(inverse.determinant());
    const Eigen::Matrix3d s = inverse * frame(bent), j = inverse * frame(got);
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(s.transpose() * j,
                                                Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Eigen::Matrix3d away = area * (j - s * svd.matrixU() * svd.matrixV().transpose());
    const Eigen::RowVector3d one = inverse.col(0).transpose() * away,
                             two = inverse.col(1).transpose() * away;
    gradient.row(mesh.faces(f, 0)) -= one + two;
    gradient.row(mesh.faces(f, 1)) += one;
    gradient.row(mesh.faces(f, 2)) += two;
    scale = std::max(scale, one.norm());
  }
  for (const Handle& handle : edit.handles) {
    for (const int v : handle.vertices) {
      gradient.row(v).setZero();
    }
  }
  EXPECT_GT(scale, 1e-3);
  EXPECT_LT(gradient.rowwise().norm().maxCoeff(), 1e-3 * scale);
}

TEST_F(FromAStartPose, TheNetworkSeesThePose) {
  const Points with = solve(edit.targets, {}, bent);
  const Points without = solve(edit.targets, {.network = false}, bent);
  EXPECT_GT(test::farthest(with, without), 1e-3 * size);
}

TEST_F(FromAStartPose, TheVolumeOfThePoseIsKept) {
  Points thin = mesh.vertices;
  thin.col(0) *= 0.5;
  const auto volume = [&](const Points& points) {
    double sum = 0.0;
    for (Eigen::Index f = 0; f < mesh.faces.rows(); ++f) {
      const Eigen::RowVector3d a = points.row(mesh.faces(f, 0)), b = points.row(mesh.faces(f, 1)),
                               c = points.row(mesh.faces(f, 2));
      sum += a.dot(b.cross(c)) / 6.0;
    }
    return sum;
  };
  const double before = volume(thin);
  for (const bool keep : {false, true}) {
    const double after = volume(solve(edit.targets, {.keep_volume = keep}, thin));
    EXPECT_LT(std::abs(after / before - 1.0), keep ? 0.08 : 0.3) << after / before;
  }
}

TEST_F(FromAStartPose, CollapsedFacesAreBorne) {
  Points flat = bent;
  flat.row(mesh.faces(40, 0)) = flat.row(mesh.faces(40, 1));
  for (const auto& [name, options] : test::kinds(10)) {
    EXPECT_TRUE(solve(edit.targets, options, flat).allFinite()) << name;
  }
}

// A limb scaled to nothing: vertices that no face with an area is at.
TEST_F(FromAStartPose, StiffStillDescendsWhereALimbIsAPoint) {
  Points shrunk = bent;
  const double height = mesh.vertices.col(2).maxCoeff();
  for (Eigen::Index v = 0; v < shrunk.rows(); ++v) {
    if (std::abs(mesh.vertices(v, 2) - 0.5 * height) < 0.25 * height) {
      shrunk.row(v) = bent.colwise().mean();
    }
  }
  const Points natural = solve(edit.targets, {}, shrunk);
  for (const EditOptions& options :
       {EditOptions{.stiffness = 1.0}, EditOptions{.method = EditMethod::arap}}) {
    const EditResult got = editor->solve(edit.targets, options, {}, start(shrunk));
    EXPECT_TRUE(got.vertices.allFinite());
    EXPECT_GT(got.report.passes, 1);
    EXPECT_GT(test::farthest(got.vertices, natural), 1e-3 * size);
  }
}

TEST(StartPose, WhatHasNoHandleStaysWithNothingAsked) {
  const zoo::Mesh two = zoo::with_unused_vertices(zoo::two_spheres(2));
  const auto rest = test::prepared(two);
  const Editor editor(rest, {test::handle_at("one", two.vertices, two.vertices.row(5), 4)},
                      test::editing_network());
  const Points bent = test::bent(two.vertices);
  for (const LoosePieces loose : {LoosePieces::follow, LoosePieces::stay}) {
    const Points got =
        editor.solve({{}}, {.loose_pieces = loose}, {}, std::make_shared<StartPose>(*rest, bent))
            .vertices;
    EXPECT_LT(test::farthest(got, bent), 2e-6 * test::diagonal(bent));
  }
}

TEST(StartPose, BadPosesAreRefused) {
  const zoo::Mesh mesh = zoo::cube();
  const auto rest = test::prepared(mesh);
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"7 vertices", "8"},
                               [&] { StartPose(*rest, Points::Zero(7, 3)); }));
  Points pose = mesh.vertices;
  pose(3, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(
      test::fails_with(ErrorCode::not_finite, {"Vertex 3"}, [&] { StartPose(*rest, pose); }));
}

}  // namespace
}  // namespace supple
