// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/feature_network.h"

namespace supple {

template <class Scalar>
FeatureContext<Scalar>::FeatureContext(const SurfaceOperators& operators, const Eigenbasis& basis,
                                       const FeatureArchitecture& architecture)
    : inputs(feature_inputs(architecture.input, operators, basis, architecture.sizes.inputs)
                 .template cast<Scalar>()),
      diffusion(operators, basis,
                std::min(architecture.eigenfunctions, static_cast<int>(basis.size()))) {}

template <class Scalar>
FeatureNetwork<Scalar> FeatureNetwork<Scalar>::random(const FeatureArchitecture& architecture,
                                                      uint64_t seed) {
  return {architecture, DiffusionParameters<Scalar>::random(architecture.sizes, seed)};
}

template <class Scalar>
RowMatrix<Scalar> FeatureNetwork<Scalar>::features(const FeatureContext<Scalar>& context,
                                                   DiffusionTrace<Scalar>* trace) const {
  return diffusion_net_forward(architecture.sizes, parameters, context.diffusion, context.inputs,
                               trace);
}

template struct FeatureContext<float>;
template struct FeatureContext<double>;
template struct FeatureNetwork<float>;
template struct FeatureNetwork<double>;

}  // namespace supple
