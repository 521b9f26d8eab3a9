// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/tasks/inbetween.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <numeric>

#include "native/tasks/editing.h"

namespace supple {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

// Few eigenfunctions: nothing here uses them.
std::shared_ptr<const PreparedMesh> rest_of(const zoo::Mesh& mesh) {
  return test::prepared(mesh, 8, 50);
}

Matrix3 turn_about(const Eigen::RowVector3d& axis, double angle) {
  // Rows: the angle is that of the transposed, column form.
  return Eigen::AngleAxisd(angle, axis.transpose().normalized()).toRotationMatrix().transpose();
}

// A closed bar of 1 x 1 x `height`, its length along z from 0.
zoo::Mesh bar(int cells, int height) { return zoo::square_tower(cells, cells * height); }

// The bar's middle line on a circle, in the plane y = 0; the low end stays.
Points arc(const Points& rest, double angle) {
  const double length = rest.col(2).maxCoeff(), radius = length / angle;
  Points result(rest.rows(), 3);
  for (Eigen::Index v = 0; v < rest.rows(); ++v) {
    const double phi = angle * rest(v, 2) / length, out = radius - rest(v, 0);
    result.row(v) << radius - out * std::cos(phi), rest(v, 1), out * std::sin(phi);
  }
  return result;
}

Points twisted(const Points& rest, double angle) {
  const double length = rest.col(2).maxCoeff();
  Points result(rest.rows(), 3);
  for (Eigen::Index v = 0; v < rest.rows(); ++v) {
    result.row(v) = rest.row(v) * turn_about({0, 0, 1}, angle * rest(v, 2) / length);
  }
  return result;
}

double volume_of(const Points& points, const Faces& faces) {
  double sum = 0.0;
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    Matrix3 corners;
    corners << points.row(faces(f, 0)), points.row(faces(f, 1)), points.row(faces(f, 2));
    sum += corners.determinant() / 6.0;
  }
  return sum;
}

Points centred(const Points& points) { return points.rowwise() - points.colwise().mean(); }

// Four poses that bend, twist and turn as a whole, at unequal times.
struct Motion {
  std::vector<Points> poses;
  std::vector<double> times = {-1.0, 0.5, 1.0, 3.0};
};
Motion motion_of(const Points& rest) {
  const Points first = test::bent(rest);
  return {{first, first * turn_about({1, 2, -1}, 1.2) + rest, test::bent(first) * 0.8,
           test::bent(rest * turn_about({0, 1, 3}, 2.0))}};
}

Inbetween inbetween(const std::shared_ptr<const PreparedMesh>& mesh, const Motion& motion,
                    bool smooth = true) {
  return Inbetween(mesh, motion.poses, motion.times, {.smooth = smooth});
}

class InbetweenZoo : public ::testing::TestWithParam<zoo::Entry> {
 protected:
  const zoo::Mesh& mesh() const { return GetParam().mesh; }
};

TEST_P(InbetweenZoo, KeysComeBackBitForBitAndAreApproached) {
  Motion motion = motion_of(mesh().vertices);
  const double size = test::diagonal(mesh().vertices);
  for (size_t k = 0; k < motion.poses.size(); ++k) {  // loose vertices need not follow
    motion.poses[k] += 0.02 * size * test::noise(mesh().vertices.rows(), 3, k);
  }
  const double travel = test::farthest(motion.poses[0], motion.poses[1]) +
                        test::farthest(motion.poses[1], motion.poses[3]);
  const Inbetween between = inbetween(rest_of(mesh()), motion);
  for (size_t k = 0; k < motion.poses.size(); ++k) {
    const double time = motion.times[k];
    EXPECT_EQ(between.at(time), motion.poses[k]) << "key " << k;
    const double side = k == 0 ? 1e-9 : -1e-9;
    EXPECT_LT(test::farthest(between.at(time + side), motion.poses[k]), 1e-7 * travel)
        << "key " << k;
  }
  EXPECT_EQ(between.at(-7.0), motion.poses.front());
  EXPECT_EQ(between.at(7.0), motion.poses.back());
}

TEST_P(InbetweenZoo, ARigidMotionGoesThroughRigidShapes) {
  const Points start = test::bent(mesh().vertices);
  const Eigen::RowVector3d axis(0.3, -1.0, 0.5);
  const double size = test::diagonal(start);
  const Points end = (start * turn_about(axis, 170.0 * kDegree)).rowwise() +
                     Eigen::RowVector3d(size * Eigen::RowVector3d(0.4, 1.0, -2.0));
  const Inbetween between(rest_of(mesh()), {start, end}, {0.0, 2.0});
  for (const double part : {0.5, 0.2}) {
    const Points expected = start * turn_about(axis, part * 170.0 * kDegree);
    EXPECT_LT(test::farthest(centred(between.at(2.0 * part)), centred(expected)), 1e-9 * size);
  }
}

SUPPLE_OVER_THE_ZOO(InbetweenZoo);

TEST(Inbetween, ABarBentAlongACircleGoesThroughCircles) {
  const zoo::Mesh mesh = bar(4, 5);
  const Points end = arc(mesh.vertices, 120.0 * kDegree);
  const Inbetween between(rest_of(mesh), {mesh.vertices, end}, {0.0, 1.0});
  for (const double part : {0.25, 0.5, 0.75}) {
    const Points expected = arc(mesh.vertices, part * 120.0 * kDegree);
    const Points got = between.at(part);
    EXPECT_LT(test::farthest(centred(got), centred(expected)), 0.01);
    EXPECT_NEAR(volume_of(got, mesh.faces), 5.0, 0.03 * 5.0);
  }
  const Points blend = 0.5 * (mesh.vertices + end);
  EXPECT_GT(test::farthest(centred(blend), centred(arc(mesh.vertices, 60.0 * kDegree))), 0.3);
  EXPECT_LT(volume_of(blend, mesh.faces), 0.9 * 5.0);
}

TEST(Inbetween, ABarTwistedByMoreThanHalfATurnTwistsAndKeepsItsWidth) {
  const zoo::Mesh mesh = bar(3, 10);
  const Points end = twisted(mesh.vertices, 300.0 * kDegree);
  const Inbetween between(rest_of(mesh), {mesh.vertices, end}, {0.0, 1.0});
  const Points got = between.at(0.5);
  // The faces are sheared, so their rotations are no pure twist: within 1.5% of the length.
  EXPECT_LT(test::farthest(got, twisted(mesh.vertices, 150.0 * kDegree)), 0.15);
  const double ends = 0.5 * (10.0 + volume_of(end, mesh.faces));
  EXPECT_NEAR(volume_of(got, mesh.faces), ends, 0.03 * ends);
}

TEST(Inbetween, TheEndOfABarTurnedBy120DegreesKeepsItsVolume) {
  const zoo::Mesh mesh = bar(2, 6);
  const double inside = volume_of(mesh.vertices, mesh.faces);
  const auto prepared = rest_of(mesh);
  for (const Eigen::RowVector3d& axis : {Eigen::RowVector3d(0, 0, 1), Eigen::RowVector3d(0, 1, 0),
                                         Eigen::RowVector3d(0.5, 1, 0.7)}) {
    test::Edit edit;
    edit.handles = {test::handle_at("low", mesh.vertices, {0, 0, 0}, 16),
                    test::handle_at("high", mesh.vertices, {0, 0, 6}, 16)};
    const Matrix3 turn = turn_about(axis, 120.0 * kDegree);
    const Eigen::RowVector3d pivot(0, 0, 3);
    edit.targets = {{}, {.matrix = test::affine(turn, pivot - pivot * turn), .positions = {}}};
    const Points end = Editor(prepared, edit.handles, nullptr).solve(edit.targets).vertices;
    const Points got = Inbetween(prepared, {mesh.vertices, end}, {0.0, 1.0}).at(0.5);
    const double mean = 0.5 * (inside + volume_of(end, mesh.faces));
    EXPECT_NEAR(volume_of(got, mesh.faces) / mean, 1.0, 0.03) << "axis " << axis;
    EXPECT_LT(volume_of(0.5 * (mesh.vertices + end), mesh.faces) / mean, 0.95);
  }
}

TEST(Inbetween, GrowthGoesLinearly) {
  const zoo::Mesh mesh = zoo::perturbed_sphere(2, 3);
  const Inbetween between(rest_of(mesh), {mesh.vertices, 3.0 * mesh.vertices}, {0.0, 1.0});
  EXPECT_LT(test::farthest(between.at(0.25), 1.5 * mesh.vertices), 1e-9);
}

TEST(Inbetween, AFlatStretchGoesLinearly) {
  const zoo::Mesh mesh = zoo::grid(6, 4, 0.5);
  const Points end = mesh.vertices * Eigen::DiagonalMatrix<double, 3>(2.5, 0.4, 1.0);
  const Inbetween between(rest_of(mesh), {mesh.vertices, end}, {0.0, 1.0});
  EXPECT_LT(test::farthest(between.at(0.3), 0.7 * mesh.vertices + 0.3 * end), 1e-9);
}

TEST(Inbetween, TheSpeedIsContinuousAcrossKeysWhereSmooth) {
  const zoo::Mesh mesh = zoo::perturbed_sphere(2, 3);
  const auto prepared = rest_of(mesh);
  const Motion motion = motion_of(mesh.vertices);
  const auto jump = [&](bool smooth, size_t key, double step) {
    const Inbetween between = inbetween(prepared, motion, smooth);
    const double time = motion.times[key];
    const Points here = between.at(time);
    const Points before = (here - between.at(time - step)) / step;
    const Points after = (between.at(time + step) - here) / step;
    return test::farthest(before, after);
  };
  for (const size_t key : {1, 2}) {
    const double coarse = jump(true, key, 2e-4), fine = jump(true, key, 1e-4);
    EXPECT_LT(fine, 0.01) << "key " << key;
    EXPECT_NEAR(fine / coarse, 0.5, 0.05) << "key " << key;  // it goes with the step
    EXPECT_GT(jump(false, key, 1e-4), 0.3) << "key " << key;
  }
}

TEST(Inbetween, TwoKeysGoAtUniformSpeedAndAreTheSameSmoothOrNot) {
  const zoo::Mesh mesh = zoo::perturbed_sphere(1, 3);
  const auto prepared = rest_of(mesh);
  Motion motion{{mesh.vertices, mesh.vertices * turn_about({1, 1, 0}, 2.0)}, {0.0, 4.0}};
  EXPECT_LT(test::farthest(centred(inbetween(prepared, motion).at(1.0)),
                           centred(mesh.vertices * turn_about({1, 1, 0}, 0.5))),
            1e-10);
  motion = {{motion_of(mesh.vertices).poses[0], motion_of(mesh.vertices).poses[1]}, {0.0, 4.0}};
  EXPECT_EQ(inbetween(prepared, motion, true).at(1.3), inbetween(prepared, motion, false).at(1.3));
}

TEST(Inbetween, RunsBackwardsOnTheSamePath) {
  const zoo::Mesh mesh = zoo::square_tower(2, 6);
  const auto prepared = rest_of(mesh);
  const Motion motion = motion_of(mesh.vertices);
  Motion back = motion;
  std::reverse(back.poses.begin(), back.poses.end());
  std::transform(motion.times.rbegin(), motion.times.rend(), back.times.begin(), std::negate<>());
  for (const double time : {-0.3, 0.6, 2.0}) {
    EXPECT_LT(
        test::farthest(inbetween(prepared, motion).at(time), inbetween(prepared, back).at(-time)),
        1e-9);
  }
}

TEST(Inbetween, TurnsAndMovesWithThePoses) {
  const zoo::Mesh mesh =
      zoo::joined(zoo::square_tower(2, 6), zoo::moved(zoo::icosphere(1), {2, 0, 0}, 0.3));
  const auto prepared = rest_of(mesh);
  const Motion motion = motion_of(mesh.vertices);
  const Inbetween between = inbetween(prepared, motion);
  const Matrix3 turn = test::rotation(2);
  const Eigen::RowVector3d shift(3.0, -1.0, 0.5);
  Motion other = motion;
  for (Points& pose : other.poses) {
    pose = (pose * turn).rowwise() + shift;
  }
  const Inbetween turned = inbetween(prepared, other);
  for (const double time : {0.0, 0.8, 2.1}) {
    EXPECT_LT(test::farthest(turned.at(time), (between.at(time) * turn).rowwise() + shift), 1e-9);
  }
}

TEST(Inbetween, TheOrderOfVerticesAndFacesIsOfNoMatter) {
  const zoo::Mesh mesh =
      zoo::joined(zoo::perturbed_sphere(2, 3), zoo::moved(zoo::icosphere(1), {2, 0, 0}, 0.3));
  const Eigen::Index n = mesh.vertices.rows();
  std::vector<int> order(static_cast<size_t>(n));
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [](int a, int b) { return a * 37 % 101 < b * 37 % 101; });
  zoo::Mesh other = mesh;
  Motion motion = motion_of(mesh.vertices), shuffled = motion;
  const auto shuffle = [&](const Points& from, Points& to) {
    for (Eigen::Index v = 0; v < n; ++v) {
      to.row(order[static_cast<size_t>(v)]) = from.row(v);
    }
  };
  shuffle(mesh.vertices, other.vertices);
  for (size_t k = 0; k < motion.poses.size(); ++k) {
    shuffle(motion.poses[k], shuffled.poses[k]);
  }
  const Eigen::Index m = mesh.faces.rows();
  for (Eigen::Index f = 0; f < m; ++f) {
    for (int c = 0; c < 3; ++c) {
      other.faces(m - 1 - f, (c + 1) % 3) = order[static_cast<size_t>(mesh.faces(f, c))];
    }
  }
  Points expected(n, 3);
  shuffle(inbetween(rest_of(mesh), motion).at(0.7), expected);
  EXPECT_LT(test::farthest(inbetween(rest_of(other), shuffled).at(0.7), expected), 1e-9);
}

TEST(Inbetween, WhatStandsStillInAllKeysStays) {
  const zoo::Mesh mesh = bar(3, 6);
  const Motion motion{{arc(mesh.vertices, 0.01), arc(mesh.vertices, 1.5), arc(mesh.vertices, 0.5)},
                      {0.0, 1.0, 2.0}};
  const Inbetween between = inbetween(rest_of(mesh), motion);
  for (const double time : {0.3, 0.5, 1.6}) {
    const Points got = between.at(time);
    for (Eigen::Index v = 0; v < got.rows(); ++v) {
      if (mesh.vertices(v, 2) == 0.0) {
        EXPECT_LT((got.row(v) - mesh.vertices.row(v)).norm(), 0.02) << "time " << time;
      }
    }
  }
}

TEST(Inbetween, APieceTurnsWithTheLargestOneAlsoBeyondHalfATurn) {
  // A bar whose end turns by 200 degrees about the far end's axis, and a ball beside that end.
  const zoo::Mesh body = bar(3, 6);
  const zoo::Mesh mesh = zoo::joined(body, zoo::moved(zoo::icosphere(1), {0.8, 0, 5.9}, 0.2));
  const auto pose = [&](double angle) {
    Points result(mesh.vertices.rows(), 3);
    for (Eigen::Index v = 0; v < result.rows(); ++v) {
      const double along = std::min(1.0, mesh.vertices(v, 2) / 5.5);
      result.row(v) = mesh.vertices.row(v) * turn_about({0, 0, 1}, along * angle);
    }
    return result;
  };
  const Inbetween between(rest_of(mesh), {mesh.vertices, pose(200.0 * kDegree)}, {0.0, 1.0});
  EXPECT_LT(test::farthest(between.at(0.5), pose(100.0 * kDegree)), 0.1);
}

TEST(Inbetween, FacesWithoutAreaInAPoseGiveNumbers) {
  const zoo::Mesh mesh = zoo::perturbed_sphere(2, 3);
  Points flat = mesh.vertices, point = Points::Zero(mesh.vertices.rows(), 3), pinched = flat;
  flat.col(1).setZero();
  flat.col(2).setZero();
  pinched.row(mesh.faces(0, 1)) = pinched.row(mesh.faces(0, 0));
  const Inbetween between(rest_of(mesh), {mesh.vertices, pinched, flat, point, pinched},
                          {0.0, 1.0, 2.0, 3.0, 4.0});
  for (const double time : {0.5, 1.5, 2.5, 3.5}) {
    EXPECT_TRUE(between.at(time).allFinite()) << "time " << time;
  }
  // An edge that all but closes goes nearly the same way.
  Points nearly = pinched;
  nearly.row(mesh.faces(0, 1)) += 1e-3 * (mesh.vertices - pinched).row(mesh.faces(0, 1));
  const Inbetween near(rest_of(mesh), {mesh.vertices, nearly}, {0.0, 1.0});
  const Inbetween closing(rest_of(mesh), {mesh.vertices, pinched}, {0.0, 1.0});
  EXPECT_LT(test::farthest(closing.at(0.5), near.at(0.5)), 0.05);
}

// Two keys by dense matrices: rotations by SVD and quaternions, the surface by least squares.
Points dense_reference(const zoo::Mesh& mesh, const Points& a, const Points& b, double s) {
  const Eigen::Index n = mesh.vertices.rows(), m = mesh.faces.rows();
  const auto frame = [&](const Points& p, Eigen::Index f) {
    Eigen::Matrix3d e;
    const Eigen::Vector3d u = p.row(mesh.faces(f, 1)) - p.row(mesh.faces(f, 0));
    const Eigen::Vector3d v = p.row(mesh.faces(f, 2)) - p.row(mesh.faces(f, 0));
    e << u.transpose(), v.transpose(), u.cross(v).normalized().transpose();
    return e;
  };
  Eigen::MatrixXd system = Eigen::MatrixXd::Zero(2 * m + 1, n),
                  wanted = Eigen::MatrixXd::Zero(2 * m + 1, 3);
  for (Eigen::Index f = 0; f < m; ++f) {
    const Eigen::Matrix3d rest = frame(mesh.vertices, f);
    Eigen::Matrix3d stretch[2], rotation[2];
    for (int k = 0; k < 2; ++k) {
      const Eigen::Matrix3d j = rest.inverse() * frame(k == 0 ? a : b, f);
      const Eigen::JacobiSVD<Eigen::Matrix3d> svd(j, Eigen::ComputeFullU | Eigen::ComputeFullV);
      rotation[k] = svd.matrixU() * svd.matrixV().transpose();
      stretch[k] = svd.matrixU() * svd.singularValues().asDiagonal() * svd.matrixU().transpose();
    }
    const Eigen::Matrix3d between = Eigen::Quaterniond(rotation[0])
                                        .slerp(s, Eigen::Quaterniond(rotation[1]))
                                        .toRotationMatrix();
    const Eigen::Matrix3d j = ((1.0 - s) * stretch[0] + s * stretch[1]) * between;
    // Derivatives along two orthonormal directions in the plane, weighted by the area's root.
    const Eigen::Vector3d u = rest.row(0).normalized(), normal = rest.row(2);
    const Eigen::Vector3d w = normal.cross(u);
    const double weight =
        std::sqrt(0.5 * Eigen::Vector3d(rest.row(0)).cross(Eigen::Vector3d(rest.row(1))).norm());
    int row = 0;
    for (const Eigen::Vector3d& direction : {u, w}) {
      const Eigen::RowVector3d parts = direction.transpose() * rest.inverse();  // of the two edges
      system(2 * f + row, mesh.faces(f, 1)) += weight * parts[0];
      system(2 * f + row, mesh.faces(f, 2)) += weight * parts[1];
      system(2 * f + row, mesh.faces(f, 0)) -= weight * (parts[0] + parts[1]);
      wanted.row(2 * f + row) = weight * direction.transpose() * j;
      ++row;
    }
  }
  system.row(2 * m).setOnes();
  return system.colPivHouseholderQr().solve(wanted);
}

TEST(Inbetween, TwoKeysAgreeWithADenseImplementation) {
  for (const zoo::Mesh& mesh :
       {zoo::tetrahedron(), zoo::perturbed_sphere(1, 4), zoo::grid(3, 2, 0.7)}) {
    const Points a = test::bent(mesh.vertices);
    const Points b = mesh.vertices * turn_about({1, 0, 2}, 1.0) + 0.1 * test::noise(a.rows(), 3, 8);
    const Inbetween between(rest_of(mesh), {a, b}, {1.0, 2.0});
    for (const double s : {0.2, 0.5}) {
      EXPECT_LT(test::farthest(centred(between.at(1.0 + s)), dense_reference(mesh, a, b, s)), 1e-9);
    }
  }
}

TEST(Inbetween, ErrorsSayWhatIsWrong) {
  const zoo::Mesh mesh = zoo::tetrahedron();
  const auto prepared = rest_of(mesh);
  const Points& pose = mesh.vertices;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto make = [&](std::vector<Points> poses, std::vector<double> times) {
    return [=] { Inbetween(prepared, poses, times); };
  };
  EXPECT_TRUE(
      test::fails_with(ErrorCode::wrong_shape, {"1 poses", "at least 2"}, make({pose}, {0})));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"2 poses", "3 times"},
                               make({pose, pose}, {0, 1, 2})));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"Pose 1", "3 vertices", "4"},
                               make({pose, pose.topRows(3)}, {0, 1})));
  EXPECT_TRUE(
      test::fails_with(ErrorCode::bad_option, {"Time 1", "Sort"}, make({pose, pose}, {1, 1})));
  EXPECT_TRUE(test::fails_with(ErrorCode::not_finite, {"Time 1"}, make({pose, pose}, {1, nan})));
  Points broken = pose;
  broken(2, 1) = nan;
  EXPECT_TRUE(test::fails_with(ErrorCode::not_finite, {"Pose 1", "vertex 2"},
                               make({pose, broken}, {0, 1})));
  const Inbetween between(prepared, {pose, pose}, {0.0, 1.0});
  EXPECT_TRUE(test::fails_with(ErrorCode::not_finite, {"time"}, [&] { between.at(nan); }));
  Progress progress;
  progress.cancel();
  EXPECT_TRUE(test::fails_with(ErrorCode::cancelled, {}, [&] {
    Inbetween(prepared, {pose, pose}, {0.0, 1.0}, {}, ProgressRange(&progress));
  }));
}

}  // namespace
}  // namespace supple
