// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/adam.h"

#include <gtest/gtest.h>

#include <cmath>

namespace supple {
namespace {

const LayerSizes kSizes{.inputs = 1, .outputs = 1, .width = 1, .projected = 0};

TEST(Adam, FirstStepsByHand) {
  auto parameters = LayerParameters<double>::zeros(kSizes), gradient = parameters;
  parameters.weights[0](0, 0) = 1.0;
  parameters.biases[1](0) = -2.0;
  Adam<double> adam(kSizes);

  // Step 1, g = 0.5: m = 0.05, v = 0.00025; corrected 0.5 and 0.25; x -= rate * 0.5 / (0.5 + 1e-8).
  gradient.weights[0](0, 0) = 0.5;
  gradient.biases[1](0) = -0.5;
  adam.step(gradient, 0.1, parameters);
  EXPECT_NEAR(parameters.weights[0](0, 0), 1.0 - 0.1 * 0.5 / (0.5 + 1e-8), 1e-15);
  EXPECT_NEAR(parameters.biases[1](0), -2.0 + 0.1 * 0.5 / (0.5 + 1e-8), 1e-15);

  // Step 2, g = -1: m = 0.9 * 0.05 - 0.1 = -0.055, v = 0.999 * 0.00025 + 0.001 = 0.00124975;
  // corrected by 1 - 0.81 = 0.19 and 1 - 0.998001 = 0.001999.
  const double before = parameters.weights[0](0, 0);
  gradient.weights[0](0, 0) = -1.0;
  adam.step(gradient, 0.01, parameters);
  const double expected =
      before - 0.01 * (-0.055 / 0.19) / (std::sqrt(0.00124975 / 0.001999) + 1e-8);
  EXPECT_NEAR(parameters.weights[0](0, 0), expected, 1e-13);
}

TEST(Adam, AZeroGradientMovesNothing) {
  auto parameters = LayerParameters<double>::random(kSizes, 1, 1.0);
  const auto before = parameters;
  Adam<double>(kSizes).step(LayerParameters<double>::zeros(kSizes), 0.1, parameters);
  EXPECT_EQ(parameters.weights, before.weights);
}

TEST(Adam, FindsTheMinimumOfAParabola) {
  auto parameters = LayerParameters<float>::zeros(kSizes), gradient = parameters;
  Adam<float> adam(kSizes);
  for (int step = 0; step < 500; ++step) {
    gradient.weights[0](0, 0) = 2.0F * (parameters.weights[0](0, 0) - 3.0F);
    adam.step(gradient, 0.05, parameters);
  }
  EXPECT_NEAR(parameters.weights[0](0, 0), 3.0F, 1e-2F);
}

TEST(LearningRate, StartsAndEndsWhereAsked) {
  EXPECT_DOUBLE_EQ(decayed_learning_rate(1e-3, 1e-5, 0, 100), 1e-3);
  EXPECT_NEAR(decayed_learning_rate(1e-3, 1e-5, 99, 100), 1e-5, 1e-18);
  EXPECT_DOUBLE_EQ(decayed_learning_rate(1e-3, 1e-5, 0, 1), 1e-3);
}

TEST(LearningRate, FallsByTheSameFactor) {
  const double factor = decayed_learning_rate(1.0, 0.01, 1, 11);
  for (int step = 1; step < 11; ++step) {
    EXPECT_NEAR(
        decayed_learning_rate(1.0, 0.01, step, 11) / decayed_learning_rate(1.0, 0.01, step - 1, 11),
        factor, 1e-14);
  }
}

}  // namespace
}  // namespace supple
