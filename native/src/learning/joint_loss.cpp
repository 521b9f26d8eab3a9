// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/joint_loss.h"

#include <string>
#include <utility>

#include "supple/core/dense.h"
#include "supple/core/error.h"
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

// What goes forward through the second network, kept for the way back.
template <class Scalar>
struct Deformation {
  Signal signal;
  typename LocalJacobianNetwork<Scalar>::Trace trace;
};

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
  for (size_t d = 0; d < 2; ++d) {
    features[d] =
        networks.features.features(pair[d]->features, gradient != nullptr ? &traces[d] : nullptr);
    progress.report(0.1 * static_cast<double>(d + 1));
  }
  const Match found =
      match<Scalar>(surfaces, features, options, progress.stage("matching", 0.2, 0.4));

  std::array<Deformation<Scalar>, 2> deformations;
  std::array<MatrixField, 2> predicted;
  for (size_t d = 0; deforms && d < 2; ++d) {
    if (pair[d]->network == nullptr) {
      throw Error(ErrorCode::bad_option,
                  "A surface of the pair was prepared without the local Jacobian network that the "
                  "loss needs.");
    }
    deformations[d].signal =
        spectral_signal(*pair[d]->match.operators, pair[d]->coarse, found[d].coarse);
    predicted[d] = networks.jacobians->forward(*pair[d]->network, deformations[d].signal,
                                               &deformations[d].trace);
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

  gradient->features = DiffusionParameters<Scalar>::zeros(networks.features.architecture.sizes);
  gradient->jacobians = {};
  if (networks.jacobians.has_value()) {
    gradient->jacobians =
        LayerParameters<Scalar>::zeros(networks.jacobians->architecture().sizes());
  }
  for (size_t d = 0; deforms && d < 2; ++d) {
    Signal of_signal;
    networks.jacobians->backward(*pair[d]->network, deformations[d].signal, deformations[d].trace,
                                 of_loss.predicted[d], gradient->jacobians, &of_signal);
    of_loss.match[d].coarse = spectral_signal_backward(*pair[d]->match.operators, pair[d]->coarse,
                                                       found[d].coarse, of_signal);
  }
  const FeaturePair<Scalar> of_features = match_backward<Scalar>(
      surfaces, features, found, of_loss.match, options, progress.stage("derivatives", 0.5, 0.9));
  for (size_t d = 0; d < 2; ++d) {
    diffusion_net_backward(networks.features.architecture.sizes, networks.features.parameters,
                           pair[d]->features.diffusion, traces[d], of_features[d],
                           gradient->features);
  }
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
