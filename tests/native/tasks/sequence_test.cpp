// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/tasks/sequence.h"

#include <Eigen/LU>

#include "native/tasks/editing.h"

namespace supple {
namespace {

using Vector = Eigen::RowVector3d;

Matrix3 about_z(double angle) {
  Matrix3 turn = Matrix3::Identity();
  turn.topLeftCorner<2, 2>() << std::cos(angle), std::sin(angle), -std::sin(angle), std::cos(angle);
  return turn;
}

Points transformed(const Eigen::Matrix4d& matrix, const Points& points) {
  return (points * matrix.topLeftCorner<3, 3>().transpose()).rowwise() +
         Vector(matrix.topRightCorner<3, 1>().transpose());
}

class Sequence : public ::testing::Test {
 protected:
  SequenceFrame frame(const Points& vertices, double share = 1.0) const {
    return {vertices, {std::nullopt, edit.targets[1].matrix}, share};
  }

  zoo::Mesh mesh = zoo::square_tower(3, 9);
  std::shared_ptr<const PreparedMesh> rest = test::prepared(mesh);
  test::Edit edit = test::bending(mesh.vertices);
  std::shared_ptr<const Editor> editor =
      std::make_shared<Editor>(rest, edit.handles, test::editing_network());
  SequenceEditor sequence{editor, EditOptions{}};
  Points bent = test::bent(mesh.vertices);
  double size = test::diagonal(mesh.vertices);
};

TEST_F(Sequence, AFrameThatAsksForNothingComesBackBitForBit) {
  EXPECT_EQ(sequence.solve(frame(bent, 0.0)), bent);
  EXPECT_EQ(sequence.solve({bent, {std::nullopt, std::nullopt}, 1.0}), bent);
  EXPECT_EQ(sequence.solve({bent, {std::nullopt, Eigen::Matrix4d::Identity()}, 1.0}), bent);
}

TEST_F(Sequence, AtRestACorrectionIsTheEdit) {
  const Points expected = editor->solve(edit.targets).vertices;
  EXPECT_LT(test::farthest(sequence.solve(frame(mesh.vertices)), expected), 1e-5 * size);
}

TEST_F(Sequence, ACorrectionTravelsWithTheBody) {
  const Matrix3 turn = test::rotation(4);
  const Vector offset(10.0, -3.0, 5.0);
  const Points expected = (sequence.solve(frame(bent)) * turn).rowwise() + offset;
  const Points got = sequence.solve(frame((bent * turn).rowwise() + offset));
  EXPECT_LT(test::farthest(got, expected), 1e-5 * size);
}

TEST_F(Sequence, AHandleIsMovedInItsOwnFrame) {
  const StartPose pose(*rest, bent);
  const Eigen::VectorXi& hand = edit.handles[1].vertices;
  const Eigen::Matrix4d at = handle_frame(*rest, hand, pose);
  const Eigen::Matrix4d whole = at * *edit.targets[1].matrix * at.inverse();
  const Points got = sequence.solve(frame(bent));
  const Points expected = transformed(whole, bent);
  for (const int v : hand) {
    EXPECT_LT((got.row(v) - expected.row(v)).norm(), 1e-9 * size);
  }
  for (const int v : edit.handles[0].vertices) {
    EXPECT_EQ(got.row(v), bent.row(v));
  }
}

TEST_F(Sequence, TheBytesDependOnNeitherThreadsNorNeighbours) {
  std::vector<SequenceFrame> frames;
  for (const double share : {1.0, 0.3, 0.0, 0.7, 0.1}) {
    frames.push_back(frame(bent, share));
  }
  const std::vector<Points> together = sequence.solve(frames);
  for (const int threads : {1, 2, 5}) {
    const test::Threads use(threads);
    EXPECT_EQ(sequence.solve(frames), together) << threads;
  }
  for (size_t i = 0; i < frames.size(); ++i) {
    EXPECT_EQ(sequence.solve(frames[i]), together[i]) << i;
  }
}

// Half the share, half the way, as small as it may be: no jump where a correction begins.
TEST_F(Sequence, ASmallShareMovesLittle) {
  const double whole = test::farthest(sequence.solve(frame(bent)), bent);
  double last = whole;
  for (const double share : {0.1, 0.01, 0.001}) {
    const double moved = test::farthest(sequence.solve(frame(bent, share)), bent);
    EXPECT_LT(moved, 3.0 * share * whole) << share;
    EXPECT_GT(moved, 0.2 * share * whole) << share;
    EXPECT_LT(moved, last);
    last = moved;
  }
}

TEST_F(Sequence, FailuresAreReported) {
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"2 handles", "1 corrections"}, [&] {
    sequence.solve({bent, {std::nullopt}, 1.0});
  }));
  SequenceFrame flat = frame(bent);
  flat.corrections[1]->row(0).setZero();
  EXPECT_TRUE(test::fails_with(ErrorCode::singular_matrix, {"scale"}, [&] {
    sequence.solve({frame(bent), flat, frame(bent)});
  }));
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"stiffness"},
                               [&] { SequenceEditor(editor, {.stiffness = 2.0}); }));
  Progress progress;
  progress.cancel();
  EXPECT_TRUE(test::fails_with(ErrorCode::cancelled, {}, [&] {
    sequence.solve({frame(bent), frame(bent)}, ProgressRange(&progress));
  }));
}

TEST_F(Sequence, AHandlesFrameIsARigidMotion) {
  const Matrix3 turn = test::rotation(6);
  const Vector offset(1.0, 2.0, -4.0);
  const Eigen::Matrix4d expected = test::affine(turn, offset);
  const StartPose pose(*rest, (mesh.vertices * turn).rowwise() + offset);
  for (const Handle& handle : {edit.handles[0], Handle{"one", Eigen::VectorXi::Constant(1, 7)}}) {
    EXPECT_LT((handle_frame(*rest, handle.vertices, pose) - expected).norm(), 1e-12 * size);
  }
  // In any pose: the centre of the handle goes to its centre, and nothing is stretched.
  const Eigen::VectorXi& hand = edit.handles[1].vertices;
  const Eigen::Matrix4d at = handle_frame(*rest, hand, StartPose(*rest, bent));
  const Eigen::Matrix3d linear = at.topLeftCorner<3, 3>();
  EXPECT_LT((linear * linear.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-12);
  EXPECT_GT(linear.determinant(), 0.0);
  const Points before = mesh.vertices(hand, Eigen::all), after = bent(hand, Eigen::all);
  EXPECT_LT((transformed(at, Points(before.colwise().mean())) - after.colwise().mean()).norm(),
            1e-12 * size);
}

TEST_F(Sequence, FramesOfWhatIsNoHandleAreRefused) {
  const StartPose pose(*rest, bent);
  EXPECT_TRUE(test::fails_with(ErrorCode::empty_handle, {"without vertices"},
                               [&] { handle_frame(*rest, Eigen::VectorXi(), pose); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::index_out_of_range, {"9999"}, [&] {
    handle_frame(*rest, Eigen::VectorXi::Constant(1, 9999), pose);
  }));
}

TEST(PartOfMotion, OfAScrew) {
  const Vector centre(2.0, 1.0, -3.0), way(0.0, 0.0, 5.0);
  const double angle = 2.5;
  const auto screw = [&](double part) {
    const Matrix3 turn = about_z(part * angle);
    return test::affine(turn, centre + part * way - centre * turn);
  };
  for (const double part : {0.0, 0.25, 0.5, 1.0}) {
    EXPECT_LT((part_of_motion(screw(1.0), centre, part) - screw(part)).norm(), 1e-9) << part;
  }
  EXPECT_EQ(part_of_motion(screw(1.0), centre, 1.0), screw(1.0));
}

TEST(PartOfMotion, OfAStretch) {
  const Matrix3 stretch = Vector(2.0, 1.0, 0.5).asDiagonal();
  const Eigen::Matrix4d half =
      part_of_motion(test::affine(stretch, Vector::Zero()), Vector::Zero(), 0.5);
  EXPECT_LT((half - test::affine(Vector(1.5, 1.0, 0.75).asDiagonal(), Vector::Zero())).norm(),
            1e-9);
}

TEST(RangeShare, BeginsAndEndsAtRest) {
  const auto share = [](double frame) { return range_share(frame, 10.0, 50.0, 10.0, 20.0); };
  EXPECT_EQ(share(10.0), 0.0);
  EXPECT_EQ(share(9.0), 0.0);
  EXPECT_EQ(share(50.0), 0.0);
  EXPECT_EQ(share(51.0), 0.0);
  for (double frame = 20.0; frame <= 30.0; ++frame) {
    EXPECT_EQ(share(frame), 1.0);
  }
  EXPECT_DOUBLE_EQ(share(15.0), 0.5);
  EXPECT_DOUBLE_EQ(share(40.0), 0.5);
  EXPECT_LT(share(11.0), 0.01);  // of the correction, a frame
  const double step = 1e-3;      // velocity and acceleration are 0 at the ends
  for (const double end : {10.0, 20.0, 30.0, 50.0}) {
    const double slope = (share(end + step) - share(end - step)) / (2.0 * step);
    const double bend = (share(end + step) - 2.0 * share(end) + share(end - step)) / (step * step);
    EXPECT_LT(std::abs(slope), 1e-6) << end;
    EXPECT_LT(std::abs(bend), 1e-4) << end;
  }
}

TEST(RangeShare, WithoutEasesIsAllOfTheRange) {
  EXPECT_EQ(range_share(5.0, 5.0, 8.0, 0.0, 0.0), 1.0);
  EXPECT_EQ(range_share(8.0, 5.0, 8.0, 0.0, 0.0), 1.0);
  EXPECT_EQ(range_share(8.5, 5.0, 8.0, 0.0, 0.0), 0.0);
  EXPECT_EQ(range_share(4.5, 5.0, 8.0, 0.0, 0.0), 0.0);
}

TEST(RangeShare, BadRangesAreRefused) {
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"before its start"},
                               [] { range_share(1.0, 5.0, 4.0, 0.0, 0.0); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"eases"},
                               [] { range_share(1.0, 0.0, 4.0, -1.0, 0.0); }));
}

}  // namespace
}  // namespace supple
