// SPDX-License-Identifier: GPL-3.0-or-later
// A network that learns features of a surface, with the input it takes.
#pragma once

#include <map>
#include <string>

#include "supple/core/types.h"
#include "supple/geometry/surface_operators.h"
#include "supple/learning/diffusion_net.h"
#include "supple/learning/feature_inputs.h"
#include "supple/spectral/eigenbasis.h"

namespace supple {

/// Everything that fixes the shapes of the weights and what they mean.
struct FeatureArchitecture {
  FeatureInput input = FeatureInput::wave_kernel;
  DiffusionSizes sizes;      ///< `sizes.inputs` channels of `input`
  int eigenfunctions = 128;  ///< diffusion is that of these

  bool operator==(const FeatureArchitecture&) const = default;
};

/// What such a network needs of a surface, built once. n vertices, area 1.
template <class Scalar>
struct FeatureContext {
  /// Errors: those of `feature_inputs` and `DiffusionContext`.
  FeatureContext(const SurfaceOperators& operators, const Eigenbasis& basis,
                 const FeatureArchitecture& architecture);

  RowMatrix<Scalar> inputs;  ///< n x inputs
  DiffusionContext<Scalar> diffusion;
};

/// Scalar is float in use, double where derivatives are checked.
template <class Scalar>
struct FeatureNetwork {
  FeatureArchitecture architecture;
  DiffusionParameters<Scalar> parameters;

  /// New weights. Errors: those of `DiffusionParameters`.
  static FeatureNetwork random(const FeatureArchitecture& architecture, uint64_t seed);
  /// n x outputs. Errors: `wrong_shape` for a surface prepared for another architecture.
  RowMatrix<Scalar> features(const FeatureContext<Scalar>& context,
                             DiffusionTrace<Scalar>* trace = nullptr) const;
};

}  // namespace supple
