// SPDX-License-Identifier: GPL-3.0-or-later
// Every derivative of the DiffusionNet against differences.
#include "native/gradient_check.h"
#include "native/learning/diffusion_nets.h"

namespace supple {
namespace {

const DiffusionSizes kSizes{.inputs = 4, .outputs = 3, .width = 5, .blocks = 2};

class DiffusionNetGradient : public ::testing::Test {
 protected:
  DiffusionNetGradient()
      : surface(zoo::perturbed_sphere(1, 2), 12),
        parameters(test::awake_diffusion_net<double>(kSizes, 3)),
        input(test::noise(surface.context.functions.rows(), kSizes.inputs, 1)),
        weights(test::noise(input.rows(), kSizes.outputs, 2)) {}
  double value() const {
    return diffusion_net_forward(kSizes, parameters, surface.context, input)
        .cwiseProduct(weights)
        .sum();
  }
  RowMatrix<double> backward(DiffusionParameters<double>& gradient) const {
    DiffusionTrace<double> trace;
    diffusion_net_forward(kSizes, parameters, surface.context, input, &trace);
    return diffusion_net_backward(kSizes, parameters, surface.context, trace, weights, gradient);
  }
  ::testing::AssertionResult check(RowMatrix<double>& variables,
                                   const RowMatrix<double>& analytic) {
    return test::gradient_matches([this] { return value(); }, test::values_of(variables),
                                  test::values_of(analytic));
  }

  const test::Threads threads{1};  // waking another takes longer than such a small network
  test::FeatureSurface<double> surface;
  DiffusionParameters<double> parameters;
  RowMatrix<double> input, weights;
};

TEST_F(DiffusionNetGradient, OfEveryOtherParameter) {
  auto gradient = DiffusionParameters<double>::zeros(kSizes);
  backward(gradient);
  const auto analytic = gradient.named();
  size_t t = 0;
  for (const auto& tensor : parameters.named()) {
    ASSERT_EQ(tensor.name, analytic[t].name);
    EXPECT_GT(analytic[t].values->norm(), 0.0) << tensor.name;
    if (!tensor.name.ends_with("times")) {
      EXPECT_TRUE(check(*tensor.values, *analytic[t].values)) << tensor.name;
    }
    ++t;
  }
}

TEST_F(DiffusionNetGradient, OfTheTimes) {
  // In hundredths: differences take steps of 1e-3, in which the highest functions decay too much.
  auto gradient = DiffusionParameters<double>::zeros(kSizes);
  backward(gradient);
  for (size_t b = 0; b < parameters.blocks.size(); ++b) {
    RowMatrix<double>& times = parameters.blocks[b].times;
    const RowMatrix<double> before = times;
    RowMatrix<double> hundredths = 100.0 * times;
    const RowMatrix<double> analytic = 0.01 * gradient.blocks[b].times;
    const auto at_times = [&] {
      times = 0.01 * hundredths;
      return value();
    };
    EXPECT_TRUE(
        test::gradient_matches(at_times, test::values_of(hundredths), test::values_of(analytic)))
        << "block " << b;
    const RowMatrix<double> wrong = 1.001 * analytic;
    EXPECT_FALSE(
        test::gradient_matches(at_times, test::values_of(hundredths), test::values_of(wrong)))
        << "block " << b;
    times = before;
  }
}

TEST_F(DiffusionNetGradient, EveryPartIsAwake) {
  DiffusionTrace<double> trace;
  diffusion_net_forward(kSizes, parameters, surface.context, input, &trace);
  for (const auto& block : trace.blocks) {
    const RowMatrix<double> size = block.products.cwiseAbs().colwise().mean();
    EXPECT_GT(size.minCoeff(), 0.02);
    EXPECT_LT(size.maxCoeff(), 0.95);
  }
}

TEST_F(DiffusionNetGradient, OfTheInput) {
  auto gradient = DiffusionParameters<double>::zeros(kSizes);
  const RowMatrix<double> analytic = backward(gradient);
  EXPECT_TRUE(check(input, analytic));
}

TEST_F(DiffusionNetGradient, TheCheckerCatchesAWrongOne) {
  auto gradient = DiffusionParameters<double>::zeros(kSizes);
  backward(gradient);
  const auto analytic = gradient.named();
  size_t t = 0;
  for (const auto& tensor : parameters.named()) {
    EXPECT_FALSE(check(*tensor.values, 1.001 * *analytic[t++].values)) << tensor.name;
  }
}

TEST_F(DiffusionNetGradient, BackwardAddsToTheGradient) {
  auto once = DiffusionParameters<double>::zeros(kSizes), twice = once;
  backward(once);
  backward(twice);
  backward(twice);
  const auto expected = once.named();
  size_t t = 0;
  for (const auto& tensor : twice.named()) {
    const RowMatrix<double>& single = *expected[t++].values;
    EXPECT_LT((*tensor.values - 2.0 * single).norm(), 1e-12 * single.norm()) << tensor.name;
  }
}

TEST_F(DiffusionNetGradient, WithoutBlocks) {
  const DiffusionSizes sizes{.inputs = 4, .outputs = 3, .width = 5, .blocks = 0};
  const auto linear = test::awake_diffusion_net<double>(sizes, 4);
  auto gradient = DiffusionParameters<double>::zeros(sizes);
  DiffusionTrace<double> trace;
  const RowMatrix<double> output =
      diffusion_net_forward(sizes, linear, surface.context, input, &trace);
  const RowMatrix<double> grad_input =
      diffusion_net_backward(sizes, linear, surface.context, trace, weights, gradient);
  const RowMatrix<double> matrix = linear.first.weight * linear.last.weight;
  RowMatrix<double> expected = input * matrix;
  expected.rowwise() += (linear.first.bias * linear.last.weight + linear.last.bias).row(0);
  EXPECT_LT((output - expected).norm(), 1e-12 * expected.norm());
  EXPECT_LT((grad_input - weights * matrix.transpose()).norm(), 1e-12 * grad_input.norm());
}

TEST_F(DiffusionNetGradient, WrongShapes) {
  auto gradient = DiffusionParameters<double>::zeros(kSizes);
  DiffusionTrace<double> trace;
  diffusion_net_forward(kSizes, parameters, surface.context, input, &trace);
  const RowMatrix<double> narrow = weights.leftCols(2);
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"gradients of the features", "x 2"}, [&] {
    diffusion_net_backward(kSizes, parameters, surface.context, trace, narrow, gradient);
  }));
  auto other = DiffusionParameters<double>::zeros({.inputs = 4, .outputs = 3, .width = 6});
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"gradients", "first.weight"}, [&] {
    diffusion_net_backward(kSizes, parameters, surface.context, trace, weights, other);
  }));
  EXPECT_EQ(gradient.last.weight, (RowMatrix<double>::Zero(5, 3)));
}

}  // namespace
}  // namespace supple
