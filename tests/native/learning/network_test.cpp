// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/network.h"

#include <limits>
#include <tuple>

#include "native/learning/networks.h"

namespace supple {
namespace {

using Kind = std::tuple<Configuration, SignalKind>;
using Tensors = std::map<std::string, RowMatrix<float>>;

class Network : public ::testing::TestWithParam<Kind> {
 protected:
  Network()
      : rest(zoo::perturbed_sphere(2, 3), 20, 0),
        target(test::bent(rest.operators.vertices)),
        architecture{.configuration = std::get<0>(GetParam()),
                     .signal = std::get<1>(GetParam()),
                     .eigenfunctions = 20,
                     .width = 24},
        signal(test::signal_of(architecture.signal, rest, target, 16)),
        network(test::awake_network<float>(architecture, 1, rest.context, signal)) {}

  test::RestMesh<float> rest;
  Points target;
  Architecture architecture;
  Signal signal;
  LocalJacobianNetwork<float> network;
};

TEST_P(Network, TensorsRoundTrip) {
  const Tensors tensors = network.tensors();
  EXPECT_EQ(tensors.size(), 2U * 6U + 2U);
  const LocalJacobianNetwork<float> copy(architecture, tensors);
  EXPECT_EQ(copy.tensors(), tensors);
  EXPECT_EQ(copy.architecture(), architecture);
  EXPECT_EQ(copy.forward(rest.context, signal), network.forward(rest.context, signal));
}

TEST_P(Network, SameBytesEveryTime) {
  EXPECT_EQ(network.forward(rest.context, signal), network.forward(rest.context, signal));
  LocalJacobianNetwork<float>::Trace trace;
  EXPECT_EQ(network.forward(rest.context, signal, &trace), network.forward(rest.context, signal));
}

TEST_P(Network, SameSeedSameWeights) {
  const LocalJacobianNetwork<float> a(architecture, 9), b(architecture, 9), c(architecture, 10);
  EXPECT_EQ(a.tensors(), b.tensors());
  EXPECT_NE(a.tensors(), c.tensors());
}

TEST_P(Network, AMissingTensor) {
  for (const auto& [name, value] : network.tensors()) {
    Tensors tensors = network.tensors();
    tensors.erase(name);
    EXPECT_TRUE(test::fails_with(ErrorCode::model_file, {name.c_str()},
                                 [&] { LocalJacobianNetwork<float>(architecture, tensors); }));
  }
}

TEST_P(Network, ATensorOfAnotherShape) {
  for (const auto& [name, value] : network.tensors()) {
    Tensors tensors = network.tensors();
    tensors[name] = RowMatrix<float>::Zero(value.rows() + 1, value.cols());
    EXPECT_TRUE(test::fails_with(ErrorCode::model_file, {name.c_str()},
                                 [&] { LocalJacobianNetwork<float>(architecture, tensors); }));
    tensors[name] = RowMatrix<float>::Zero(value.rows(), value.cols() - 1);
    EXPECT_TRUE(test::fails_with(ErrorCode::model_file, {name.c_str()},
                                 [&] { LocalJacobianNetwork<float>(architecture, tensors); }));
  }
}

TEST_P(Network, ATensorThatIsNotFinite) {
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    for (const auto& [name, value] : network.tensors()) {
      Tensors tensors = network.tensors();
      tensors[name](0, value.cols() / 2) = bad;
      EXPECT_TRUE(test::fails_with(ErrorCode::model_file, {name.c_str()},
                                   [&] { LocalJacobianNetwork<float>(architecture, tensors); }));
    }
  }
}

TEST_P(Network, WeightsOfAnotherArchitecture) {
  Architecture other = architecture;
  other.width = 25;
  EXPECT_TRUE(test::fails_with(ErrorCode::model_file, {"layer.0.weight", "24", "25"},
                               [&] { LocalJacobianNetwork<float>(other, network.tensors()); }));
}

INSTANTIATE_TEST_SUITE_P(
    Kinds, Network,
    ::testing::Combine(::testing::Values(Configuration::paper, Configuration::equivariant),
                       ::testing::Values(SignalKind::rotation, SignalKind::spectral)),
    [](const auto& info) {
      return std::string(to_string(std::get<0>(info.param))) + "_" +
             to_string(std::get<1>(info.param));
    });

TEST(EquivariantNetwork, HardlyChangesItsSignalBeforeTraining) {
  const test::RestMesh<float> rest(zoo::perturbed_sphere(3, 3), 64, 300);
  for (const SignalKind kind : {SignalKind::rotation, SignalKind::spectral}) {
    const Signal signal = test::signal_of(kind, rest, test::bent(rest.operators.vertices), 30);
    const LocalJacobianNetwork<float> network({.signal = kind, .eigenfunctions = 64}, 3);
    const MatrixField change = network.forward(rest.context, signal) - signal.fields.back();
    EXPECT_LT(change.norm(), 0.05 * signal.fields.back().norm()) << to_string(kind);
  }
}

TEST(PaperNetwork, TakesEveryVertex) {
  const test::RestMesh<float> rest(zoo::perturbed_sphere(2, 3), 20, 50);
  const LocalJacobianNetwork<float> network(
      {.configuration = Configuration::paper, .eigenfunctions = 20, .width = 8}, 3);
  const Signal signal =
      test::signal_of(SignalKind::rotation, rest, test::bent(rest.operators.vertices));
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"paper", "every vertex"},
                               [&] { network.forward(rest.context, signal); }));
}

TEST(NetworkContext, EndsItsScalesWholeAndAscending) {
  const test::RestMesh<double> rest(zoo::icosphere(3), 100, 300);
  const auto& scales = rest.context.scales;
  ASSERT_EQ(scales.size(), 5U);
  for (size_t s = 1; s < scales.size(); ++s) {
    EXPECT_LE(scales[s - 1], scales[s]);
  }
  EXPECT_EQ(scales[0], 4);  // 8 would cut through the five functions of l = 2
  EXPECT_EQ(scales.back(), rest.context.functions.cols());
}

TEST(NetworkContext, ShapeIsTheDistanceToTheSmoothedSurface) {
  const test::RestMesh<double> rest(zoo::perturbed_sphere(2, 3), 100, 0);
  const auto& shape = rest.context.rest.shape;
  ASSERT_EQ(shape.cols(), 10);
  for (Eigen::Index p = 0; p < shape.rows(); ++p) {
    for (int s = 0; s < 5; ++s) {
      EXPECT_LE(std::abs(shape(p, 2 * s)), shape(p, 2 * s + 1) * (1.0 + 1e-12));
    }
  }
  // More functions keep more of the shape.
  EXPECT_GT(shape.col(1).norm(), 3.0 * shape.col(9).norm());
}

TEST(Names, OfConfigurationsAndSignals) {
  EXPECT_EQ(configuration("paper"), Configuration::paper);
  EXPECT_EQ(configuration("equivariant"), Configuration::equivariant);
  EXPECT_EQ(signal_kind("rotation"), SignalKind::rotation);
  EXPECT_EQ(signal_kind("spectral"), SignalKind::spectral);
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"'magic'"}, [] { configuration("magic"); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"'magic'"}, [] { signal_kind("magic"); }));
}

}  // namespace
}  // namespace supple
