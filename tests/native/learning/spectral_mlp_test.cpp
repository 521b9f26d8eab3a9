// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/spectral_mlp.h"

#include <cmath>

#include "native/gradient_check.h"
#include "native/support.h"
#include "supple/geometry/surface_operators.h"

namespace supple {
namespace {

const LayerSizes kSizes{.inputs = 5, .outputs = 4, .width = 7};

class SpectralMlp : public ::testing::TestWithParam<int> {  // points, 0 for every vertex
 protected:
  SpectralMlp() {
    const zoo::Mesh mesh = zoo::perturbed_sphere(1, 2);
    const SurfaceOperators operators(TriangleMesh(mesh.vertices, mesh.faces));
    const Eigenbasis basis = eigenbasis(operators.laplacian, operators.mass, {.count = 6});
    const Eigen::Index points = GetParam() > 0 ? GetParam() : operators.mass.size();
    domain = sampled_domain<double>(basis, 6, operators.vertices,
                                    farthest_point_samples(operators.vertices, points));
    parameters = LayerParameters<double>::random(kSizes, 3, 1.0);
    for (size_t l = 0; l < parameters.biases.size(); ++l) {
      parameters.biases[l] = 0.3 * test::noise(1, parameters.biases[l].size(), l);
    }
    input = test::noise(points, 5, 1);
    weights = test::noise(points, 4, 2);
  }
  double value() const {
    return spectral_mlp_forward(kSizes, parameters, domain, input).cwiseProduct(weights).sum();
  }
  RowMatrix<double> backward(LayerParameters<double>& gradient) const {
    SpectralMlpTrace<double> trace;
    spectral_mlp_forward(kSizes, parameters, domain, input, &trace);
    return spectral_mlp_backward(kSizes, parameters, domain, trace, weights, gradient);
  }
  ::testing::AssertionResult check(std::span<double> variables, std::span<const double> analytic) {
    return test::gradient_matches([this] { return value(); }, variables, analytic);
  }

  SpectralDomain<double> domain;
  LayerParameters<double> parameters;
  RowMatrix<double> input, weights;
};

TEST_P(SpectralMlp, GradientOfEveryLayer) {
  auto gradient = LayerParameters<double>::zeros(kSizes);
  backward(gradient);
  for (size_t l = 0; l < gradient.weights.size(); ++l) {
    EXPECT_TRUE(check(test::values_of(parameters.weights[l]),
                      test::values_of(std::as_const(gradient.weights[l]))))
        << "weights of layer " << l;
    EXPECT_TRUE(check(test::values_of(parameters.biases[l]),
                      test::values_of(std::as_const(gradient.biases[l]))))
        << "bias of layer " << l;
  }
}

TEST_P(SpectralMlp, GradientOfTheInput) {
  auto gradient = LayerParameters<double>::zeros(kSizes);
  const RowMatrix<double> analytic = backward(gradient);
  EXPECT_TRUE(check(test::values_of(input), test::values_of(analytic)));
}

TEST_P(SpectralMlp, TheCheckerCatchesAWrongLayer) {
  auto gradient = LayerParameters<double>::zeros(kSizes);
  backward(gradient);
  for (size_t l = 0; l < gradient.weights.size(); ++l) {
    RowMatrix<double> wrong = gradient.weights[l];
    wrong *= 1.001;
    EXPECT_FALSE(
        check(test::values_of(parameters.weights[l]), test::values_of(std::as_const(wrong))))
        << "layer " << l;
  }
}

TEST_P(SpectralMlp, BackwardAddsToTheGradient) {
  auto once = LayerParameters<double>::zeros(kSizes),
       twice = LayerParameters<double>::zeros(kSizes);
  backward(once);
  backward(twice);
  backward(twice);
  for (size_t l = 0; l < once.weights.size(); ++l) {
    EXPECT_LT((twice.weights[l] - 2.0 * once.weights[l]).norm(), 1e-12 * once.weights[l].norm());
    EXPECT_LT((twice.biases[l] - 2.0 * once.biases[l]).norm(), 1e-12 * once.biases[l].norm());
  }
}

TEST_P(SpectralMlp, IsTheDeclaredFormula) {
  // Written out at every point, without the shortcut through the coefficients.
  const auto silu = [](const RowMatrix<double>& x) {
    return RowMatrix<double>(x.unaryExpr([](double v) { return v / (1.0 + std::exp(-v)); }));
  };
  RowMatrix<double> x = input;
  for (int l = 0; l < kSizes.count(); ++l) {
    x = (x * parameters.weights[l]).eval();
    x.rowwise() += parameters.biases[l];
    if (l + 1 < kSizes.count()) {
      x = silu(x);
    }
    if (l < kSizes.projected) {
      x = (domain.functions * (domain.projector * x)).eval();
    }
  }
  EXPECT_LT((x - spectral_mlp_forward(kSizes, parameters, domain, input)).norm(), 1e-12 * x.norm());
}

TEST_P(SpectralMlp, WrongShapeOfTheInput) {
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"5 inputs"}, [&] {
    spectral_mlp_forward(kSizes, parameters, domain,
                         RowMatrix<double>(test::noise(input.rows(), 4, 1)));
  }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {}, [&] {
    spectral_mlp_forward(kSizes, parameters, domain, RowMatrix<double>(test::noise(3, 5, 1)));
  }));
}

INSTANTIATE_TEST_SUITE_P(Domain, SpectralMlp, ::testing::Values(0, 25), [](const auto& info) {
  return info.param == 0 ? "every_vertex" : "samples";
});

TEST(LayerSizes, AreThePapers) {
  const LayerSizes sizes;
  EXPECT_EQ(sizes.count(), 6);
  EXPECT_EQ(sizes.rows(0), 9);
  EXPECT_EQ(sizes.cols(0), 256);
  EXPECT_EQ(sizes.rows(5), 256);
  EXPECT_EQ(sizes.cols(5), 9);
}

TEST(LayerParameters, SameSeedSameBytes) {
  const auto a = LayerParameters<double>::random(kSizes, 5, 1.0);
  const auto b = LayerParameters<double>::random(kSizes, 5, 1.0);
  const auto c = LayerParameters<double>::random(kSizes, 6, 1.0);
  EXPECT_EQ(a.weights, b.weights);
  EXPECT_NE(a.weights, c.weights);
}

TEST(LayerParameters, AreGlorotUniform) {
  const LayerSizes sizes{.inputs = 20, .outputs = 30, .width = 40};
  const auto parameters = LayerParameters<double>::random(sizes, 5, 0.5);
  for (int l = 0; l < sizes.count(); ++l) {
    const double gain = l + 1 == sizes.count() ? 0.5 : 1.0;
    const double bound = gain * std::sqrt(6.0 / (sizes.rows(l) + sizes.cols(l)));
    EXPECT_LE(parameters.weights[l].cwiseAbs().maxCoeff(), bound);
    EXPECT_GT(parameters.weights[l].cwiseAbs().maxCoeff(), 0.95 * bound);
    EXPECT_LT(std::abs(parameters.weights[l].mean()), 0.1 * bound);
    EXPECT_TRUE(parameters.biases[l].isZero(0.0));
  }
}

TEST(LayerParameters, CastKeepsTheNumbers) {
  const auto a = LayerParameters<double>::random(kSizes, 5, 1.0);
  const auto b = a.cast<float>().cast<double>();
  for (size_t l = 0; l < a.weights.size(); ++l) {
    EXPECT_TRUE(a.weights[l].isApprox(b.weights[l], 1e-6));
  }
}

}  // namespace
}  // namespace supple
