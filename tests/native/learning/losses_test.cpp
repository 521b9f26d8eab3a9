// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/losses.h"

#include <vector>

#include "native/gradient_check.h"
#include "native/support.h"
#include "supple/geometry/jacobians.h"

namespace supple {
namespace {

class Loss : public ::testing::TestWithParam<zoo::Entry> {
 protected:
  Loss()
      : operators(TriangleMesh(GetParam().mesh.vertices, GetParam().mesh.faces)),
        poisson(operators.laplacian, operators.mass, operators.component,
                operators.component_count),
        target(test::bent(operators.vertices)),
        predicted(operators.jacobians_of(target)) {
    predicted += 0.2 * MatrixField(test::noise(predicted.rows(), 9, 3));
  }
  LossValues loss(const LossWeights& weights, MatrixField* grad = nullptr) const {
    return supervised_loss(operators, poisson, weights, target, predicted, grad);
  }

  SurfaceOperators operators;
  FreePoisson poisson;
  Points target;
  MatrixField predicted;
};

TEST_P(Loss, GradientOfEachTermAndOfAll) {
  for (const LossWeights weights :
       {LossWeights{1, 0, 0}, LossWeights{0, 1, 0}, LossWeights{0, 0, 1}, LossWeights{}}) {
    MatrixField analytic;
    loss(weights, &analytic);
    EXPECT_TRUE(test::gradient_matches([&] { return loss(weights).total; },
                                       test::values_of(predicted),
                                       test::values_of(std::as_const(analytic)), 60))
        << "weights " << weights.jacobian << " " << weights.position << " " << weights.integrated;
  }
}

TEST_P(Loss, GradientWithHeldVertices) {
  // One vertex of each piece and a few more.
  std::vector<int> held = {5, 6};
  for (int c = 0; c < operators.component_count; ++c) {
    int i = 0;
    while (operators.component[i] != c) {
      ++i;
    }
    held.push_back(i);
  }
  const HeldSystem system(
      operators.laplacian,
      Eigen::VectorXi::Map(held.data(), static_cast<Eigen::Index>(held.size())));
  const auto total = [&](MatrixField* grad) {
    return supervised_loss(operators, system, {}, target, predicted, grad).total;
  };
  MatrixField analytic;
  total(&analytic);
  EXPECT_TRUE(test::gradient_matches([&] { return total(nullptr); }, test::values_of(predicted),
                                     test::values_of(std::as_const(analytic)), 60));
  predicted = operators.jacobians_of(target);
  EXPECT_LT(total(nullptr), 1e-16);
}

TEST_P(Loss, TheCheckerCatchesAMissingPoissonTerm) {
  MatrixField jacobian_only;
  loss({1, 0, 0}, &jacobian_only);
  EXPECT_FALSE(test::gradient_matches([&] { return loss({}).total; }, test::values_of(predicted),
                                      test::values_of(std::as_const(jacobian_only)), 60));
}

TEST_P(Loss, IsZeroOnTheTrueJacobians) {
  predicted = operators.jacobians_of(target);
  MatrixField grad;
  const LossValues values = loss({}, &grad);
  EXPECT_LT(values.total, 1e-16);
  EXPECT_LT(grad.cwiseAbs().maxCoeff(), 1e-7);
}

TEST_P(Loss, DoesNotSeeWhereTheTargetIs) {
  const LossValues before = loss({});
  target.rowwise() += Eigen::RowVector3d(3, -2, 5);
  EXPECT_NEAR(loss({}).total, before.total, 1e-9 * before.total);
}

std::vector<zoo::Entry> shapes() {
  return {{.name = "sphere", .mesh = zoo::perturbed_sphere(0, 3)},
          {.name = "two_pieces",
           .mesh = zoo::joined(zoo::tetrahedron(), zoo::moved(zoo::cube(), {4, 0, 0}))},
          {.name = "disc", .mesh = zoo::disc(2, 6)}};
}
INSTANTIATE_TEST_SUITE_P(Shapes, Loss, ::testing::ValuesIn(shapes()), test::entry_name);

TEST(LossByHand, AUniformErrorOfTheJacobians) {
  // Every prediction is 2 I where the truth is I, on a surface of area 1: a1 = |I|^2 = 3. The
  // embedding is twice the rest; its frames are twice the edges but a unit normal, so a3 = |P|^2 =
  // 2 (the tangent plane); a2 is the second moment of the rest about its centroid.
  const zoo::Mesh mesh = zoo::perturbed_sphere(1, 3);
  const SurfaceOperators operators(TriangleMesh(mesh.vertices, mesh.faces));
  const FreePoisson poisson(operators.laplacian, operators.mass, operators.component, 1);
  MatrixField predicted = operators.jacobians_of(2.0 * operators.vertices);
  for (Eigen::Index f = 0; f < predicted.rows(); ++f) {
    matrix_at(predicted, f) = 2.0 * Matrix3::Identity();
  }
  const LossValues loss =
      supervised_loss(operators, poisson, {}, operators.vertices, predicted, nullptr);
  const double moment =
      operators.mass.dot(poisson.centred(operators.vertices).rowwise().squaredNorm());
  EXPECT_NEAR(loss.jacobian, 3.0, 1e-12);
  EXPECT_NEAR(loss.integrated, 2.0, 1e-10);
  EXPECT_NEAR(loss.position, moment, 1e-10);
  EXPECT_NEAR(loss.total, 3.0 + 10.0 * moment + 2.0 * 2.0, 1e-9);
}

}  // namespace
}  // namespace supple
