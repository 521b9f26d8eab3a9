// SPDX-License-Identifier: GPL-3.0-or-later
// Rotations of handles, however they are given, are shared out along what lies between them.
#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "native/tasks/editing.h"
#include "supple/geometry/jacobians.h"
#include "supple/geometry/mesh.h"
#include "supple/tasks/metrics.h"

namespace supple {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

double volume(const Points& vertices, const Faces& faces) {
  double sum = 0.0;
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    const Eigen::RowVector3d a = vertices.row(faces(f, 0)), b = vertices.row(faces(f, 1)),
                             c = vertices.row(faces(f, 2));
    sum += a.dot(b.cross(c)) / 6.0;
  }
  return sum;
}

// A bar of 1 x 1 x 6 along z about the axis.
class TwistedBar : public ::testing::Test {
 protected:
  static constexpr double kHeight = 6.0;
  TwistedBar() {
    handles = {{"bottom", slice(0.0)}, {"top", slice(kHeight)}};
    editor = std::make_shared<const Editor>(test::prepared(mesh), handles, nullptr);
  }
  Eigen::VectorXi slice(double height) const {
    std::vector<int> rows;
    for (int i = 0; i < mesh.vertices.rows(); ++i) {
      if (std::abs(mesh.vertices(i, 2) - height) < 1e-9) {
        rows.push_back(i);
      }
    }
    return Eigen::Map<Eigen::VectorXi>(rows.data(), static_cast<Eigen::Index>(rows.size()));
  }
  Matrix3 about_z(double degrees) const {
    return Eigen::AngleAxisd(degrees * kDegree, Eigen::Vector3d::UnitZ())
        .toRotationMatrix()
        .transpose();
  }
  // How far a slice has turned, in degrees from 0 to 360.
  double turn_of(const Points& posed, double height) const {
    const Eigen::VectorXi rows = slice(height);
    Points rest(rows.size(), 3), now(rows.size(), 3);
    for (Eigen::Index i = 0; i < rows.size(); ++i) {
      rest.row(i) = mesh.vertices.row(rows[i]);
      now.row(i) = posed.row(rows[i]);
    }
    const Matrix3 turn = closest_rotation((rest.rowwise() - rest.colwise().mean()).transpose() *
                                          Points(now.rowwise() - now.colwise().mean()));
    const double angle = std::atan2(turn(0, 1), turn(0, 0)) / kDegree;
    return angle < -1.0 ? angle + 360.0 : angle;
  }
  void expect_shared_out(const HandleTarget& top, const EditOptions& options,
                         const std::string& name) const {
    const Points got = editor->solve({{}, top}, options).vertices;
    // The half turn about a line across the middle takes one half to the other.
    EXPECT_NEAR(turn_of(got, 3.0), 85.0, 1.5) << name;
    // A hollow bar strains least where it crumples: least distortion gathers the twist and loses
    // volume, with an eighth of the others' distortion. What keeps the shape shares it out, between
    // linear and what flattens towards the ends.
    const bool strains_least = options.stiffness > 0.0;
    if (!strains_least) {
      EXPECT_NEAR(turn_of(got, 1.0), 28.3, 12.0) << name;
      EXPECT_NEAR(turn_of(got, 5.0), 170.0 - 28.3, 12.0) << name;
    }
    EXPECT_GT(volume(got, mesh.faces),
              (strains_least ? 0.5 : 0.75) * volume(mesh.vertices, mesh.faces))
        << name;
    const double area = face_areas(got, mesh.faces).sum();
    EXPECT_GT(area, 0.85 * face_areas(mesh.vertices, mesh.faces).sum()) << name;
    EXPECT_EQ(flipped_faces(mesh.vertices, mesh.faces, got), 0) << name;
  }

  zoo::Mesh mesh = zoo::square_tower(3, 18);
  std::vector<Handle> handles;
  std::shared_ptr<const Editor> editor;
};

TEST_F(TwistedBar, ByAMatrix) {
  const HandleTarget top{.matrix = test::affine(about_z(170.0), {0, 0, 0}), .positions = {}};
  for (const auto& [name, options] : test::kinds()) {
    expect_shared_out(top, options, name);
  }
}

TEST_F(TwistedBar, ByPositions) {
  const Eigen::VectorXi rows = handles[1].vertices;
  Points positions(rows.size(), 3);
  for (Eigen::Index i = 0; i < rows.size(); ++i) {
    positions.row(i) = mesh.vertices.row(rows[i]) * about_z(170.0);
  }
  for (const auto& [name, options] : test::kinds()) {
    expect_shared_out({.matrix = {}, .positions = positions}, options, name);
  }
}

TEST_F(TwistedBar, MatricesAndPositionsOfOneMotionAreOneEdit) {
  const Matrix3 turn =
      Eigen::AngleAxisd(1.2, Eigen::Vector3d(1, 0.4, 0.2).normalized()).toRotationMatrix();
  const HandleTarget matrix{.matrix = test::affine(turn, {0.5, 1.0, -1.0}), .positions = {}};
  const Eigen::VectorXi rows = handles[1].vertices;
  Points positions(rows.size(), 3);
  for (Eigen::Index i = 0; i < rows.size(); ++i) {
    positions.row(i) = mesh.vertices.row(rows[i]) * turn + Eigen::RowVector3d(0.5, 1.0, -1.0);
  }
  const Points a = editor->solve({{}, matrix}).vertices;
  const Points b = editor->solve({{}, {.matrix = {}, .positions = positions}}).vertices;
  // Positions leave a trace of the surroundings' own turn in the rotation, a hundredth.
  EXPECT_LT(test::farthest(a, b), 0.01 * kHeight);
}

TEST_F(TwistedBar, BentByARightAngleTheMiddleTurnsByHalfOfIt) {
  // The top swings about x to lie along -y, on a quarter circle of the bar's length.
  const double radius = kHeight / (0.5 * std::numbers::pi);
  const Matrix3 turn =
      Eigen::AngleAxisd(90.0 * kDegree, Eigen::Vector3d::UnitX()).toRotationMatrix().transpose();
  const Eigen::RowVector3d top(0, 0, kHeight), to(0, -radius, radius);
  const HandleTarget target{.matrix = test::affine(turn, to - top * turn), .positions = {}};
  for (const auto& [name, options] : test::kinds()) {
    const Points got = editor->solve({{}, target}, options).vertices;
    const Eigen::VectorXi rows = slice(3.0);
    Eigen::RowVector3d middle = Eigen::RowVector3d::Zero();
    for (const int i : rows) {
      middle += got.row(i) / static_cast<double>(rows.size());
    }
    // The halves mirror each other, so the middle stays where the quarter circle's own mirror is.
    EXPECT_NEAR(middle.x(), 0.0, 0.02 * kHeight) << name;
    EXPECT_NEAR(middle.y() + radius, middle.z(), 0.02 * kHeight) << name;
    // On the circle, but for least distortion, which gathers the bend of a hollow bar in a kink.
    const bool strains_least = options.stiffness > 0.0;
    const double from_centre = std::hypot(middle.y() + radius, middle.z());
    EXPECT_NEAR(from_centre, radius, (strains_least ? 0.1 : 0.05) * kHeight) << name;
    EXPECT_GT(volume(got, mesh.faces), (strains_least ? 0.7 : 0.8) * kHeight) << name;
  }
}

TEST_F(TwistedBar, WithoutRoundsItIsTheInterpolatedRotationsAlready) {
  const HandleTarget top{.matrix = test::affine(about_z(170.0), {0, 0, 0}), .positions = {}};
  expect_shared_out(top, {.rounds = 0, .polish = 0}, "suggestion");
}

}  // namespace
}  // namespace supple
