// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/joint_loss.h"

#include <functional>
#include <string>
#include <utility>

#include "supple/core/dense.h"
#include "supple/core/error.h"
#include "supple/core/parallel.h"
#include "supple/learning/functional_map_loss.h"

namespace supple {
namespace {

// Functions that do not cut through a multiple eigenvalue; the maps of a turned mesh would differ.
Eigen::Index function_count(const Eigenbasis& basis, int functions) {
  if (functions < 1) {
    throw Error(ErrorCode::bad_option, std::to_string(functions) +
                                           " functions of a surface are asked for; at least 1 is "
                                           "needed.");
  }
  return basis.stable_count(functions);
}

// step(0) and step(1), at once where that is a better use of the threads than one after the other:
// two or three of them wait too much within a step.
void for_both_surfaces(const std::function<void(size_t)>& step) {
  if (thread_count() == 2 || thread_count() == 3) {
    run_at_once(2, step);
  } else {
    step(0);
    step(1);
  }
}

// What goes forward through the second network, kept for the way back.
template <class Scalar>
struct Deformation {
  Signal signal;
  typename LocalJacobianNetwork<Scalar>::Trace trace;
};

template <class Scalar>
JointGradient<Scalar> zero_gradient(const JointNetworks<Scalar>& networks) {
  JointGradient<Scalar> gradient;
  gradient.features = DiffusionParameters<Scalar>::zeros(networks.features.architecture.sizes);
  if (networks.jacobians.has_value()) {
    gradient.jacobians = LayerParameters<Scalar>::zeros(networks.jacobians->architecture().sizes());
  }
  return gradient;
}

template <class Scalar>
void add(const JointGradient<Scalar>& part, JointGradient<Scalar>& sum) {
  const auto from = part.features.named();
  const auto to = sum.features.named();
  for (size_t t = 0; t < to.size(); ++t) {
    *to[t].values += *from[t].values;
  }
  for (size_t l = 0; l < sum.jacobians.weights.size(); ++l) {
    sum.jacobians.weights[l] += part.jacobians.weights[l];
    sum.jacobians.biases[l] += part.jacobians.biases[l];
  }
}

}  // namespace

template <class Scalar>
JointSurface<Scalar>::JointSurface(const SurfaceOperators& operators, const Eigenbasis& basis,
                                   const FeatureArchitecture& architecture, int functions,
                                   std::shared_ptr<const NetworkContext<Scalar>> network_in)
    : features(operators, basis, architecture),
      match(operators, basis, function_count(basis, functions)),
      coarse(product(match.functions, match.coordinates)),
      network(std::move(network_in)) {}

template <class Scalar>
JointLossValues joint_loss(const JointNetworks<Scalar>& networks, const JointPair<Scalar>& pair,
                           const UnsupervisedOptions& options, const Guide& guide,
                           JointGradient<Scalar>* gradient, ProgressRange progress) {
  const SurfacePair surfaces = {&pair[0]->match, &pair[1]->match};
  const bool deforms = networks.jacobians.has_value() && options.jacobians.any();
  std::array<DiffusionTrace<Scalar>, 2> traces;
  FeaturePair<Scalar> features;
  for_both_surfaces([&](size_t d) {
    features[d] =
        networks.features.features(pair[d]->features, gradient != nullptr ? &traces[d] : nullptr);
  });
  progress.report(0.2);
  const Match found =
      match<Scalar>(surfaces, features, options, progress.stage("matching", 0.2, 0.4));

  std::array<Deformation<Scalar>, 2> deformations;
  std::array<MatrixField, 2> predicted;
  const auto deform = [&](size_t d) {
    if (pair[d]->network == nullptr) {
      throw Error(ErrorCode::bad_option,
                  "A surface of the pair was prepared without the local Jacobian network that the "
                  "loss needs.");
    }
    deformations[d].signal =
        spectral_signal(*pair[d]->match.operators, pair[d]->coarse, found[d].coarse);
    predicted[d] = networks.jacobians->forward(*pair[d]->network, deformations[d].signal,
                                               &deformations[d].trace);
  };
  if (deforms) {
    for_both_surfaces(deform);
  }

  UnsupervisedLossGradient of_loss;
  JointLossValues loss;
  loss.terms = unsupervised_loss(surfaces, found, predicted, options,
                                 gradient != nullptr ? &of_loss : nullptr);
  for (size_t d = 0; guide.weight > 0.0 && d < 2; ++d) {
    loss.guide += coupling_loss(guide.maps[d], found[d].soft_map, guide.weight, nullptr,
                                gradient != nullptr ? &of_loss.match[d].soft_map : nullptr);
  }
  if (gradient == nullptr) {
    progress.report(1.0);
    return loss;
  }

  // Of each surface, and then their sum.
  std::array<JointGradient<Scalar>, 2> parts = {zero_gradient(networks), zero_gradient(networks)};
  if (deforms) {
    for_both_surfaces([&](size_t d) {
      Signal of_signal;
      networks.jacobians->backward(*pair[d]->network, deformations[d].signal, deformations[d].trace,
                                   of_loss.predicted[d], parts[d].jacobians, &of_signal);
      of_loss.match[d].coarse = spectral_signal_backward(*pair[d]->match.operators, pair[d]->coarse,
                                                         found[d].coarse, of_signal);
    });
  }
  const FeaturePair<Scalar> of_features = match_backward<Scalar>(
      surfaces, features, found, of_loss.match, options, progress.stage("derivatives", 0.5, 0.9));
  for_both_surfaces([&](size_t d) {
    diffusion_net_backward(networks.features.architecture.sizes, networks.features.parameters,
                           pair[d]->features.diffusion, traces[d], of_features[d],
                           parts[d].features);
  });
  *gradient = std::move(parts[0]);
  add(parts[1], *gradient);
  progress.report(1.0);
  return loss;
}

template struct JointSurface<float>;
template struct JointSurface<double>;
#define SUPPLE_INSTANTIATE(Scalar)                                                            \
  template JointLossValues joint_loss(const JointNetworks<Scalar>&, const JointPair<Scalar>&, \
                                      const UnsupervisedOptions&, const Guide&,               \
                                      JointGradient<Scalar>*, ProgressRange);
SUPPLE_INSTANTIATE(float)
SUPPLE_INSTANTIATE(double)
#undef SUPPLE_INSTANTIATE

}  // namespace supple
