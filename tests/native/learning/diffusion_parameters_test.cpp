// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>

#include "native/learning/diffusion_nets.h"

namespace supple {
namespace {

const DiffusionSizes kSizes{.inputs = 4, .outputs = 3, .width = 5, .blocks = 2};

TEST(DiffusionParameters, ComeBackFromTheirTensors) {
  const auto parameters = test::awake_diffusion_net<float>(kSizes, 3);
  const auto tensors = parameters.tensors();
  EXPECT_EQ(tensors.size(), 2 + 2 * (3 + 6) + 2U);
  EXPECT_EQ(tensors.at("block.1.layer.0.weight").rows(), 15);
  EXPECT_EQ(tensors.at("block.0.times").cols(), 5);
  EXPECT_EQ(DiffusionParameters<float>::from_tensors(kSizes, tensors).tensors(), tensors);
}

TEST(DiffusionParameters, ForeignTensors) {
  const auto fails = [](std::map<std::string, RowMatrix<float>> tensors,
                        std::initializer_list<const char*> parts) {
    return test::fails_with(ErrorCode::model_file, parts,
                            [&] { DiffusionParameters<float>::from_tensors(kSizes, tensors); });
  };
  const auto good = test::awake_diffusion_net<float>(kSizes, 3).tensors();
  auto bad = good;
  bad.erase("block.1.real");
  EXPECT_TRUE(fails(bad, {"no tensor 'block.1.real'"}));
  bad = good;
  bad["last.bias"] = RowMatrix<float>::Zero(1, 4);
  EXPECT_TRUE(fails(bad, {"'last.bias' is 1 x 4, not 1 x 3"}));
  bad = good;
  bad["first.weight"](2, 1) = NAN;
  EXPECT_TRUE(fails(bad, {"'first.weight'", "not finite"}));
  bad = good;
  bad["block.0.times"](0, 3) = -1e-3F;
  EXPECT_TRUE(fails(bad, {"'block.0.times'", "negative"}));
}

TEST(DiffusionParameters, SizesThatAreNone) {
  for (const DiffusionSizes& sizes : {DiffusionSizes{.inputs = 0}, DiffusionSizes{.outputs = 0},
                                      DiffusionSizes{.width = 0}, DiffusionSizes{.blocks = -1}}) {
    EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"cannot be built"},
                                 [&] { DiffusionParameters<float>::random(sizes, 1); }));
  }
}

TEST(DiffusionParameters, StartAsStated) {
  const auto parameters = DiffusionParameters<double>::random({}, 3);
  const auto same = DiffusionParameters<double>::random({}, 3);
  EXPECT_EQ(parameters.tensors(), same.tensors());
  EXPECT_NE(parameters.tensors(), DiffusionParameters<double>::random({}, 4).tensors());
  for (const auto& tensor : parameters.named()) {
    const RowMatrix<double>& values = *tensor.values;
    if (tensor.name.ends_with("bias")) {
      EXPECT_TRUE(values.isZero(0.0)) << tensor.name;
      continue;
    }
    if (tensor.name.ends_with("times")) {
      EXPECT_GE(values.minCoeff(), 0.0) << tensor.name;
      EXPECT_LT(values.minCoeff(), 0.002) << tensor.name;
      EXPECT_GT(values.maxCoeff(), 0.018) << tensor.name;
      EXPECT_LE(values.maxCoeff(), 0.02) << tensor.name;
      continue;
    }
    const double bound = std::sqrt(6.0 / static_cast<double>(values.rows() + values.cols()));
    EXPECT_LE(values.cwiseAbs().maxCoeff(), bound) << tensor.name;
    EXPECT_GT(values.cwiseAbs().maxCoeff(), 0.95 * bound) << tensor.name;
    EXPECT_LT(std::abs(values.mean()), 0.1 * bound) << tensor.name;
  }
}

TEST(DiffusionAdam, MovesEveryTensorByItsRateAtFirst) {
  // The first corrected step is rate * g / (|g| + 1e-8), whatever the size of g.
  auto parameters = test::awake_diffusion_net<double>(kSizes, 3), gradient = parameters;
  uint64_t seed = 50;
  for (const auto& tensor : gradient.named()) {
    *tensor.values = test::noise(tensor.values->rows(), tensor.values->cols(), ++seed);
  }
  const auto before = parameters;
  DiffusionAdam<double> adam(kSizes);
  adam.step(gradient, 1e-3, parameters);
  const auto start = before.named();
  const auto slope = gradient.named();
  size_t t = 0;
  for (const auto& tensor : parameters.named()) {
    const auto g = slope[t].values->array();
    const auto expected = start[t].values->array() - 1e-3 * g / (g.abs() + 1e-8);
    EXPECT_LT((tensor.values->array() - expected).abs().maxCoeff(), 1e-12) << tensor.name;
    ++t;
  }
}

TEST(DiffusionAdam, KeepsTimesAtZeroOrAbove) {
  auto parameters = DiffusionParameters<double>::zeros(kSizes), gradient = parameters;
  gradient.blocks[0].times << 1.0, -1.0, 1.0, -1.0, 0.0;
  DiffusionAdam<double> adam(kSizes);
  for (int step = 0; step < 3; ++step) {
    adam.step(gradient, 0.1, parameters);
  }
  const RowMatrix<double>& times = parameters.blocks[0].times;
  EXPECT_EQ(times(0, 0), 0.0);
  EXPECT_NEAR(times(0, 1), 0.3, 1e-6);
  EXPECT_EQ(times(0, 4), 0.0);
}

TEST(DiffusionAdam, RefusesOtherSizes) {
  auto parameters = DiffusionParameters<double>::random(kSizes, 3);
  DiffusionAdam<double> adam(DiffusionSizes{.inputs = 4, .outputs = 3, .width = 6, .blocks = 2});
  const auto before = parameters.tensors();
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"sizes"},
                               [&] { adam.step(parameters, 0.1, parameters); }));
  EXPECT_EQ(parameters.tensors(), before);
}

}  // namespace
}  // namespace supple
