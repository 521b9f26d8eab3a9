// SPDX-License-Identifier: GPL-3.0-or-later
// Derivatives of whole networks, through the losses and the Poisson solve.
#include <tuple>

#include "native/gradient_check.h"
#include "native/learning/networks.h"
#include "supple/learning/losses.h"

namespace supple {
namespace {

using Kind = std::tuple<Configuration, SignalKind, int>;  // samples

class NetworkGradient : public ::testing::TestWithParam<Kind> {
 protected:
  NetworkGradient()
      : rest(zoo::perturbed_sphere(1, 3), 10, std::get<2>(GetParam())),
        poisson(rest.operators.laplacian, rest.operators.mass, rest.operators.component, 1),
        target(test::bent(rest.operators.vertices)),
        architecture{.configuration = std::get<0>(GetParam()),
                     .signal = std::get<1>(GetParam()),
                     .eigenfunctions = 10,
                     .width = 5},
        signal(test::signal_of(architecture.signal, rest, target)),
        network(test::awake_network<double>(architecture, 7, rest.context, signal, 2.0)) {}

  double loss() const {
    return supervised_loss(rest.operators, poisson, {}, target,
                           network.forward(rest.context, signal), nullptr)
        .total;
  }
  LayerParameters<double> gradient() const {
    LocalJacobianNetwork<double>::Trace trace;
    const MatrixField predicted = network.forward(rest.context, signal, &trace);
    MatrixField grad;
    supervised_loss(rest.operators, poisson, {}, target, predicted, &grad);
    auto result = LayerParameters<double>::zeros(architecture.sizes());
    network.backward(rest.context, signal, trace, grad, result);
    return result;
  }
  ::testing::AssertionResult check(std::span<double> variables, std::span<const double> analytic) {
    return test::gradient_matches([this] { return loss(); }, variables, analytic, 25);
  }

  test::RestMesh<double> rest;
  FreePoisson poisson;
  Points target;
  Architecture architecture;
  Signal signal;
  LocalJacobianNetwork<double> network;
};

TEST_P(NetworkGradient, OfTheSupervisedLoss) {
  const LayerParameters<double> analytic = gradient();
  auto& parameters = network.parameters();
  for (size_t l = 0; l < parameters.weights.size(); ++l) {
    EXPECT_TRUE(check(test::values_of(parameters.weights[l]), test::values_of(analytic.weights[l])))
        << "weights of layer " << l;
    EXPECT_TRUE(check(test::values_of(parameters.biases[l]), test::values_of(analytic.biases[l])))
        << "bias of layer " << l;
  }
}

TEST_P(NetworkGradient, TheCheckerCatchesAWrongOne) {
  const LayerParameters<double> analytic = gradient();
  auto& parameters = network.parameters();
  for (size_t l = 0; l < parameters.weights.size(); ++l) {
    const RowMatrix<double> wrong = 1.001 * analytic.weights[l];
    EXPECT_FALSE(check(test::values_of(parameters.weights[l]), test::values_of(wrong)))
        << "weights of layer " << l;
  }
}

TEST_P(NetworkGradient, TheNetworkIsAwake) {
  // The checks above would prove little on a network that changes nothing.
  const MatrixField change = network.forward(rest.context, signal) - signal.fields.back();
  EXPECT_GT(change.norm(), 0.005 * signal.fields.back().norm());
}

INSTANTIATE_TEST_SUITE_P(
    Kinds, NetworkGradient,
    ::testing::Values(Kind{Configuration::paper, SignalKind::rotation, 0},
                      Kind{Configuration::paper, SignalKind::spectral, 0},
                      Kind{Configuration::equivariant, SignalKind::rotation, 0},
                      Kind{Configuration::equivariant, SignalKind::spectral, 0},
                      Kind{Configuration::equivariant, SignalKind::rotation, 30},
                      Kind{Configuration::equivariant, SignalKind::spectral, 30}),
    [](const auto& info) {
      return std::string(to_string(std::get<0>(info.param))) + "_" +
             to_string(std::get<1>(info.param)) +
             (std::get<2>(info.param) == 0 ? "_full" : "_sampled");
    });

}  // namespace
}  // namespace supple
