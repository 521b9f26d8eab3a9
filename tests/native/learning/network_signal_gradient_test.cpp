// SPDX-License-Identifier: GPL-3.0-or-later
// Derivatives of whole networks with respect to their signal, and to the coarse target it is of.
#include <tuple>

#include "native/gradient_check.h"
#include "native/learning/networks.h"

namespace supple {
namespace {

using Kind = std::tuple<Configuration, SignalKind, int>;  // samples

// A random functional of a network's Jacobians.
class NetworkSignalGradient : public ::testing::TestWithParam<Kind> {
 protected:
  static constexpr int kCount = 8;
  // Eigenfunctions in two bands, and a vertex's star among many: all sums have several terms.
  explicit NetworkSignalGradient(const zoo::Mesh& mesh = zoo::perturbed_sphere(1, 3))
      : rest(mesh, 20, std::get<2>(GetParam())),
        architecture{.configuration = std::get<0>(GetParam()),
                     .signal = std::get<1>(GetParam()),
                     .eigenfunctions = 20,
                     .width = 5},
        signal(test::signal_of(architecture.signal, rest, test::bent(rest.operators.vertices),
                               kCount)),
        network(test::awake_network<double>(architecture, 7, rest.context, signal, 2.0)),
        weights(test::noise(rest.operators.faces.rows(), 9, 17)) {}

  double value(const Signal& of) const {
    return network.forward(rest.context, of).cwiseProduct(weights).sum();
  }
  LayerParameters<double> gradient_of_weights(Signal* of_signal) const {
    LocalJacobianNetwork<double>::Trace trace;
    network.forward(rest.context, signal, &trace);
    auto result = LayerParameters<double>::zeros(architecture.sizes());
    network.backward(rest.context, signal, trace, weights, result, of_signal);
    return result;
  }
  Signal gradient() const {
    Signal result;
    gradient_of_weights(&result);
    return result;
  }
  ::testing::AssertionResult check(size_t field, const MatrixField& analytic) {
    return test::gradient_matches([this] { return value(signal); },
                                  test::values_of(signal.fields[field]), test::values_of(analytic),
                                  40, 1e-6);
  }

  test::RestMesh<double> rest;
  Architecture architecture;
  Signal signal;
  LocalJacobianNetwork<double> network;
  MatrixField weights;
};

TEST_P(NetworkSignalGradient, OfEachField) {
  const Signal analytic = gradient();
  ASSERT_EQ(analytic.fields.size(), signal.fields.size());
  for (size_t i = 0; i < signal.fields.size(); ++i) {
    EXPECT_TRUE(check(i, analytic.fields[i])) << "field " << i;
  }
}

TEST_P(NetworkSignalGradient, TheCheckCatchesAWrongOne) {
  // Of all there is, only what does not pass through the layers' input is 1% too large.
  const Signal analytic = gradient();
  if (architecture.configuration == Configuration::paper) {
    EXPECT_FALSE(check(0, 1.01 * analytic.fields[0]));
    return;
  }
  auto still = network;
  auto& parameters = still.parameters();
  parameters.weights.front().setZero();  // the input no longer matters
  std::swap(network, still);
  const Signal direct = gradient();
  std::swap(network, still);
  const MatrixField wrong = analytic.fields.back() + 0.01 * direct.fields.back();
  EXPECT_FALSE(check(signal.fields.size() - 1, wrong));
}

TEST_P(NetworkSignalGradient, TheLayersInputMatters) {
  // The checks above would prove little of the input's part if that were small.
  const Signal analytic = gradient();
  network.parameters().weights.front().setZero();
  const MatrixField part = analytic.fields.front() - gradient().fields.front();
  EXPECT_GT(part.norm(), 0.005 * analytic.fields.front().norm());
}

TEST_P(NetworkSignalGradient, LeavesThatOfTheWeights) {
  Signal of_signal;
  const LayerParameters<double> with = gradient_of_weights(&of_signal);
  const LayerParameters<double> without = gradient_of_weights(nullptr);
  for (size_t l = 0; l < with.weights.size(); ++l) {
    EXPECT_EQ(with.weights[l], without.weights[l]);
    EXPECT_EQ(with.biases[l], without.biases[l]);
  }
}

TEST_P(NetworkSignalGradient, IsTheSameEachTime) {
  const Signal once = gradient(), again = gradient();
  for (size_t i = 0; i < once.fields.size(); ++i) {
    EXPECT_EQ(once.fields[i], again.fields[i]) << "field " << i;
  }
}

std::string kind_name(const ::testing::TestParamInfo<Kind>& info) {
  return std::string(to_string(std::get<0>(info.param))) + "_" +
         to_string(std::get<1>(info.param)) + (std::get<2>(info.param) == 0 ? "_full" : "_sampled");
}

INSTANTIATE_TEST_SUITE_P(
    Kinds, NetworkSignalGradient,
    ::testing::Values(Kind{Configuration::paper, SignalKind::rotation, 0},
                      Kind{Configuration::paper, SignalKind::spectral, 0},
                      Kind{Configuration::equivariant, SignalKind::rotation, 0},
                      Kind{Configuration::equivariant, SignalKind::spectral, 0},
                      Kind{Configuration::equivariant, SignalKind::rotation, 36},
                      Kind{Configuration::equivariant, SignalKind::spectral, 36}),
    kind_name);

// The whole way back: Jacobians, network, signal, coarse target.
class NetworkCoarseTargetGradient : public NetworkSignalGradient {};

TEST_P(NetworkCoarseTargetGradient, OfTheWholeChain) {
  const Points source = rest.basis.project(rest.operators.vertices, kCount);
  Points target = rest.basis.project(test::bent(rest.operators.vertices), kCount);
  signal = spectral_signal(rest.operators, source, target);
  const Points analytic = spectral_signal_backward(rest.operators, source, target, gradient());
  const auto check_chain = [&](const Points& derivative) {
    return test::gradient_matches(
        [&] { return value(spectral_signal(rest.operators, source, target)); },
        test::values_of(target), test::values_of(derivative), 40, 1e-6);
  };
  EXPECT_TRUE(check_chain(analytic));
  EXPECT_FALSE(check_chain(1.01 * analytic));
}

INSTANTIATE_TEST_SUITE_P(
    Kinds, NetworkCoarseTargetGradient,
    ::testing::Values(Kind{Configuration::paper, SignalKind::spectral, 0},
                      Kind{Configuration::equivariant, SignalKind::spectral, 0},
                      Kind{Configuration::equivariant, SignalKind::spectral, 36}),
    kind_name);

// More vertices than are worked on together: sums of several chunks.
class NetworkSignalGradientOfChunks : public NetworkSignalGradient {
 protected:
  NetworkSignalGradientOfChunks() : NetworkSignalGradient(zoo::perturbed_sphere(4, 3)) {}
};

TEST_P(NetworkSignalGradientOfChunks, AlongADirection) {
  ASSERT_GT(rest.operators.vertices.rows(), 2048);
  const Signal analytic = gradient();
  const Signal start = signal;
  Signal direction;
  double expected = 0.0;
  for (size_t i = 0; i < signal.fields.size(); ++i) {
    // A part common to all faces moves the reference and every average.
    direction.fields.push_back(test::noise(weights.rows(), 9, 40 + i));
    direction.fields.back().rowwise() += Eigen::Matrix<double, 1, 9>::Constant(0.3);
    expected += analytic.fields[i].cwiseProduct(direction.fields.back()).sum();
  }
  double t = 0.0;
  const auto along = [&] {
    for (size_t i = 0; i < signal.fields.size(); ++i) {
      signal.fields[i] = start.fields[i] + t * direction.fields[i];
    }
    return value(signal);
  };
  EXPECT_NEAR(test::central_difference(along, t), expected, 1e-6 * std::abs(expected));
}

INSTANTIATE_TEST_SUITE_P(Kinds, NetworkSignalGradientOfChunks,
                         ::testing::Values(Kind{Configuration::equivariant, SignalKind::spectral,
                                                200}),
                         kind_name);

TEST(NetworkSignalGradientInFloat, IsThatInDouble) {
  const test::RestMesh<double> rest(zoo::perturbed_sphere(2, 3), 20, 60);
  const test::RestMesh<float> single(zoo::perturbed_sphere(2, 3), 20, 60);
  const Architecture architecture{.signal = SignalKind::spectral, .eigenfunctions = 20, .width = 8};
  const Signal signal =
      test::signal_of(architecture.signal, rest, test::bent(rest.operators.vertices));
  const auto network = test::awake_network<double>(architecture, 7, rest.context, signal);
  const LocalJacobianNetwork<float> rounded(architecture, network.tensors());
  const LocalJacobianNetwork<double> exact(architecture, network.tensors());
  const MatrixField weights = test::noise(rest.operators.faces.rows(), 9, 17);
  const auto gradient = [&]<class Scalar>(const LocalJacobianNetwork<Scalar>& of,
                                          const NetworkContext<Scalar>& context) {
    typename LocalJacobianNetwork<Scalar>::Trace trace;
    of.forward(context, signal, &trace);
    auto parameters = LayerParameters<Scalar>::zeros(architecture.sizes());
    Signal result;
    of.backward(context, signal, trace, weights, parameters, &result);
    return result;
  };
  const Signal expected = gradient(exact, rest.context), got = gradient(rounded, single.context);
  for (size_t i = 0; i < 2; ++i) {
    EXPECT_LT((got.fields[i] - expected.fields[i]).norm(), 1e-4 * expected.fields[i].norm());
  }
}

}  // namespace
}  // namespace supple
