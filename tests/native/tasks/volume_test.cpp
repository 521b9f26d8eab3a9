// SPDX-License-Identifier: GPL-3.0-or-later
#include "tasks/edit/volume.h"

#include <Eigen/LU>
#include <cmath>
#include <numbers>

#include "native/gradient_check.h"
#include "native/tasks/editing.h"
#include "supple/geometry/mesh.h"
#include "supple/tasks/metrics.h"
#include "tasks/edit/energies.h"

namespace supple {
namespace {

SurfaceOperators operators_of(const zoo::Mesh& mesh) {
  return SurfaceOperators(TriangleMesh(mesh.vertices, mesh.faces));
}

// A second implementation: tetrahedra from the origin, one loop over faces.
double volume_of(const Points& points, const Faces& faces) {
  double sum = 0.0;
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    Matrix3 corners;
    corners << points.row(faces(f, 0)), points.row(faces(f, 1)), points.row(faces(f, 2));
    sum += corners.determinant() / 6.0;
  }
  return sum;
}

TEST(EnclosedVolume, OfACubeInUnitsOfItsSurface) {
  const SurfaceOperators operators = operators_of(zoo::cube());
  const EnclosedVolume volume(operators);
  ASSERT_EQ(volume.at_rest().size(), 1);
  EXPECT_NEAR(volume.at_rest()[0], std::pow(6.0, -1.5), 1e-12);
}

TEST(EnclosedVolume, OfEachClosedComponentAndNoneOfOthers) {
  const zoo::Mesh cube = zoo::cube();
  const SurfaceOperators operators =
      operators_of(zoo::joined(cube, zoo::moved(zoo::disc(3, 8), Eigen::RowVector3d(9, 0, 0))));
  const EnclosedVolume volume(operators);
  ASSERT_EQ(volume.at_rest().size(), 2);
  const int piece = operators.component[0];
  EXPECT_GT(volume.at_rest()[piece], 0.0);
  EXPECT_EQ(volume.at_rest()[1 - piece], 0.0);
  for (const zoo::Mesh& open :
       {zoo::open_cylinder(8, 5), zoo::moebius(12, 3), zoo::disc(3, 8), zoo::three_sheets(2)}) {
    const SurfaceOperators its = operators_of(open);
    EXPECT_EQ(EnclosedVolume(its).at_rest().maxCoeff(), 0.0);
  }
}

TEST(EnclosedVolume, GradientAgainstFiniteDifferences) {
  const SurfaceOperators operators = operators_of(zoo::perturbed_sphere(1, 3));
  const EnclosedVolume volume(operators);
  Points moved = test::bent(operators.vertices);
  const Points gradient = volume.gradient(moved);
  EXPECT_NEAR(volume.of(moved, gradient)[0], volume_of(moved, operators.faces), 1e-12);
  EXPECT_TRUE(test::gradient_matches([&] { return volume_of(moved, operators.faces); },
                                     test::values_of(moved), test::values_of(gradient)));
}

TEST(EnclosedVolume, RestoresMostOfWhatIsLostAndMovesNothingThatIsHeld) {
  const SurfaceOperators operators = operators_of(zoo::perturbed_sphere(2, 3));
  const EnclosedVolume volume(operators);
  Eigen::VectorXi held(4);
  held << 0, 5, 40, 41;
  const HeldSystem poisson(operators.laplacian, held);
  Points squeezed = operators.vertices;
  squeezed.col(0) *= 0.97;
  Points moved = squeezed;
  const Points way = poisson.correction(volume.gradient(squeezed));
  volume.restore(volume.at_rest(), way, moved);
  const double lost = volume.at_rest()[0] - volume_of(squeezed, operators.faces);
  EXPECT_NEAR(volume_of(moved, operators.faces), volume_of(squeezed, operators.faces) + 0.7 * lost,
              1e-9);
  for (const int v : held) {
    EXPECT_EQ(moved.row(v), squeezed.row(v));
  }
  moved = squeezed;
  volume.restore(Eigen::VectorXd::Zero(1), way, moved);
  EXPECT_EQ(moved, squeezed);
}

TEST(EnclosedVolume, OfTheStiffEnergyHasAGradient) {
  const SurfaceOperators operators =
      operators_of(zoo::joined(zoo::perturbed_sphere(1, 3), zoo::disc(3, 8)));
  const EnclosedVolume volume(operators);
  const StiffEnergy with(operators, &volume, volume.at_rest()), without(operators);
  Points moved = test::bent(operators.vertices), gradient, other;
  moved.col(1) *= 0.8;
  EXPECT_GT(with.evaluate(moved, gradient), without.evaluate(moved, other) + 0.005);
  EXPECT_TRUE(test::gradient_matches([&] { return with.evaluate(moved, other); },
                                     test::values_of(moved),
                                     test::values_of(std::as_const(gradient))));
}

class KeptVolume : public ::testing::Test {
 protected:
  // Its end turned by a quarter about an axis across, as a finger bends.
  KeptVolume() {
    const double low = mesh.vertices.col(2).minCoeff(), high = mesh.vertices.col(2).maxCoeff();
    std::vector<int> foot, top;
    for (int v = 0; v < mesh.vertices.rows(); ++v) {
      const double share = (mesh.vertices(v, 2) - low) / (high - low);
      if (share < 0.2) {
        foot.push_back(v);
      } else if (share > 0.8) {
        top.push_back(v);
      }
    }
    const auto indices = [](const std::vector<int>& of) {
      return Eigen::VectorXi(
          Eigen::Map<const Eigen::VectorXi>(of.data(), static_cast<Eigen::Index>(of.size())));
    };
    handles = {{"foot", indices(foot)}, {"top", indices(top)}};
    Matrix3 quarter;  // rows: z turns to x
    quarter << 0, 0, -1, 0, 1, 0, 1, 0, 0;
    const double middle = 0.5 * (high - low) * 2.0 / std::numbers::pi;
    const Eigen::RowVector3d centre(mesh.vertices.col(0).mean(), mesh.vertices.col(1).mean(), high);
    const Eigen::RowVector3d goal =
        centre + Eigen::RowVector3d(middle, 0.0, -(high - low) * 0.5 + 0.3 * middle);
    targets = {{}, {.matrix = test::affine(quarter, goal - centre * quarter), .positions = {}}};
  }
  double kept(const EditOptions& options, const std::vector<HandleTarget>& to) const {
    const Points posed = editor->solve(to, options).vertices;
    return volume_of(posed, mesh.faces) / volume_of(mesh.vertices, mesh.faces);
  }

  zoo::Mesh mesh = zoo::square_tower(4, 20);
  std::vector<Handle> handles;
  std::vector<HandleTarget> targets;
  std::shared_ptr<const PreparedMesh> prepared = test::prepared(mesh);
  std::shared_ptr<const Editor> editor;
  void SetUp() override { editor = std::make_shared<Editor>(prepared, handles, nullptr); }
};

TEST_F(KeptVolume, ABentBarKeepsItsVolumeAtBothEnds) {
  for (const double stiffness : {0.0, 1.0}) {
    const double with = kept({.stiffness = stiffness}, targets);
    const double without = kept({.stiffness = stiffness, .keep_volume = false}, targets);
    // At the stiff end the least strain counts for more.
    EXPECT_NEAR(with, 1.0, stiffness == 0.0 ? 0.05 : 0.15) << stiffness;
    EXPECT_LT(std::abs(with - 1.0), 0.6 * std::abs(without - 1.0)) << stiffness;
    EXPECT_TRUE(editor->solve(targets, {.stiffness = stiffness}).report.volume_kept);
  }
}

TEST_F(KeptVolume, NotWhereAHandleIsMeantToGrowNorForArap) {
  std::vector<HandleTarget> grown = targets;
  const Matrix3 larger = 1.3 * Matrix3::Identity();
  grown[1].matrix = test::affine(larger, Eigen::RowVector3d::Zero());
  EXPECT_FALSE(editor->solve(grown).report.volume_kept);
  EXPECT_EQ(editor->solve(grown).vertices, editor->solve(grown, {.keep_volume = false}).vertices);
  EXPECT_FALSE(editor->solve(targets, {.method = EditMethod::arap}).report.volume_kept);
}

}  // namespace
}  // namespace supple
