// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/feature_inputs.h"

#include <cmath>

#include "native/support.h"

namespace supple {
namespace {

struct Surface {
  explicit Surface(const zoo::Mesh& mesh)
      : operators(TriangleMesh(mesh.vertices, mesh.faces)),
        basis(eigenbasis(operators.laplacian, operators.mass, {.count = 30})) {}
  RowMatrix<double> inputs(FeatureInput kind, int count) const {
    return feature_inputs(kind, operators, basis, count);
  }
  SurfaceOperators operators;
  Eigenbasis basis;
};

class Intrinsic : public ::testing::TestWithParam<FeatureInput> {};

TEST_P(Intrinsic, MeansAreOne) {
  const Surface surface(zoo::perturbed_sphere(2, 3));
  const RowMatrix<double> inputs = surface.inputs(GetParam(), 16);
  ASSERT_EQ(inputs.cols(), 16);
  const Eigen::RowVectorXd mean = surface.operators.mass.transpose() * inputs;
  EXPECT_LT((mean.array() - 1.0).abs().maxCoeff(), 1e-9);
  EXPECT_GT((inputs.array() - 1.0).abs().maxCoeff(), 1e-2);
}

TEST_P(Intrinsic, DoNotMoveOrGrowWithTheSurface) {
  zoo::Mesh mesh = zoo::perturbed_sphere(2, 3);
  const RowMatrix<double> before = Surface(mesh).inputs(GetParam(), 16);
  mesh.vertices = 3.0 * mesh.vertices * test::rotation(2);
  mesh.vertices.rowwise() += Eigen::RowVector3d(1.0, -2.0, 5.0);
  const RowMatrix<double> after = Surface(mesh).inputs(GetParam(), 16);
  EXPECT_LT((after - before).norm(), 1e-6 * before.norm());
}

INSTANTIATE_TEST_SUITE_P(Kinds, Intrinsic,
                         ::testing::Values(FeatureInput::wave_kernel, FeatureInput::heat_kernel),
                         [](const auto& info) { return to_string(info.param); });

TEST(FeatureInputs, HeatTimesAreThoseOfSunEtAl) {
  const Surface surface(zoo::perturbed_sphere(2, 3));
  const Eigen::VectorXd& values = surface.basis.values;
  const RowMatrix<double> inputs = surface.inputs(FeatureInput::heat_kernel, 5);
  const double least = 4.0 * std::log(10.0) / values[values.size() - 1],
               most = 4.0 * std::log(10.0) / values[1];
  for (int j = 0; j < 5; ++j) {
    const double time = least * std::pow(most / least, j / 4.0);
    Eigen::VectorXd heat = Eigen::VectorXd::Zero(inputs.rows());
    double trace = 0.0;
    for (Eigen::Index i = 0; i < values.size(); ++i) {
      heat += std::exp(-values[i] * time) * surface.basis.functions.col(i).cwiseAbs2();
      trace += std::exp(-values[i] * time);
    }
    EXPECT_LT((inputs.col(j) - heat / trace).norm(), 1e-9 * heat.norm());
  }
}

TEST(FeatureInputs, CoordinatesAreTheSurfaces) {
  const Surface surface(zoo::perturbed_sphere(2, 3));
  EXPECT_EQ(surface.inputs(FeatureInput::coordinates, 3),
            RowMatrix<double>(surface.operators.vertices));
}

TEST(FeatureInputs, NamesComeBack) {
  for (const FeatureInput kind :
       {FeatureInput::wave_kernel, FeatureInput::heat_kernel, FeatureInput::coordinates}) {
    EXPECT_EQ(feature_input(to_string(kind)), kind);
  }
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"'xyz'", "'coordinates'"},
                               [] { feature_input("xyz"); }));
}

TEST(FeatureInputs, CountsThatAreNone) {
  const Surface surface(zoo::perturbed_sphere(1, 3));
  const auto fails = [&](FeatureInput kind, int count) {
    return test::fails_with(ErrorCode::bad_option, {to_string(kind), "Use "},
                            [&] { surface.inputs(kind, count); });
  };
  EXPECT_TRUE(fails(FeatureInput::wave_kernel, 0));
  EXPECT_TRUE(fails(FeatureInput::heat_kernel, 1));
  EXPECT_TRUE(fails(FeatureInput::coordinates, 2));
  EXPECT_TRUE(fails(FeatureInput::coordinates, 4));
}

TEST(FeatureInputs, ConstantsOnly) {
  const SurfaceOperators operators(
      TriangleMesh(zoo::two_spheres(1).vertices, zoo::two_spheres(1).faces));
  const Eigenbasis basis = eigenbasis(operators.laplacian, operators.mass, {.count = 2});
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"wave_kernel", "the basis has 2"}, [&] {
    feature_inputs(FeatureInput::wave_kernel, operators, basis, 8);
  }));
}

}  // namespace
}  // namespace supple
