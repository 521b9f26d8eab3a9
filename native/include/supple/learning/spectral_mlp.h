// SPDX-License-Identifier: GPL-3.0-or-later
// The dense heart of the Local Jacobian Network: layers per point, smoothed by spectral projection.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "supple/core/types.h"
#include "supple/spectral/sampling.h"

namespace supple {

/// Sizes of the layers. Source: the paper, section 4.6 and Eqn 4: four layers of `width`, each
/// followed by projection to the eigenfunctions, then two without (`width`, outputs).
struct LayerSizes {
  int inputs = 9;
  int outputs = 9;
  int width = 256;
  int projected = 4;

  int count() const { return projected + 2; }
  int rows(int layer) const { return layer == 0 ? inputs : width; }
  int cols(int layer) const { return layer == count() - 1 ? outputs : width; }
  bool operator==(const LayerSizes&) const = default;
};

/// Weights (rows(l) x cols(l)) and biases (cols(l)) of each layer; also the shape of their
/// gradients.
template <class Scalar>
struct LayerParameters {
  std::vector<RowMatrix<Scalar>> weights;
  std::vector<Eigen::Matrix<Scalar, 1, Eigen::Dynamic>> biases;

  static LayerParameters zeros(const LayerSizes& sizes);
  /// Glorot uniform weights, zero biases; the last layer's weights times `last_gain`.
  static LayerParameters random(const LayerSizes& sizes, uint64_t seed, double last_gain);
  template <class Other>
  LayerParameters<Other> cast() const;
};

/// What `spectral_mlp_forward` keeps for the backward pass.
template <class Scalar>
struct SpectralMlpTrace {
  RowMatrix<Scalar> input;                       // p x inputs
  std::vector<RowMatrix<Scalar>> preactivation;  // p x width, before each activation
  std::vector<RowMatrix<Scalar>> spectral;       // k x width, after each projection
  RowMatrix<Scalar> last;                        // p x width, the last layer's input
};

/// p x inputs to p x outputs: x -> Proj(a(x W + b)) four times, then a(x W + b), then x W + b.
///
/// The paper does not name the activation a, nor its place. Here a is SiLU, x / (1 + exp(-x))
/// (smooth, so that derivatives can be checked), after each linear map and before the projection;
/// the last map has none. A projected feature is Phi S with k x width coefficients S, so the next
/// linear map is applied to S: the same numbers as on all p points, at k / p of the cost.
template <class Scalar>
RowMatrix<Scalar> spectral_mlp_forward(const LayerSizes& sizes,
                                       const LayerParameters<Scalar>& parameters,
                                       const SpectralDomain<Scalar>& domain,
                                       const RowMatrix<Scalar>& input,
                                       SpectralMlpTrace<Scalar>* trace = nullptr);

/// Adds the gradient with respect to every parameter to `gradient` and returns p x inputs, the one
/// with respect to the input; `grad_output` is p x outputs, `trace` that of the forward pass.
template <class Scalar>
RowMatrix<Scalar> spectral_mlp_backward(const LayerSizes& sizes,
                                        const LayerParameters<Scalar>& parameters,
                                        const SpectralDomain<Scalar>& domain,
                                        const SpectralMlpTrace<Scalar>& trace,
                                        const RowMatrix<Scalar>& grad_output,
                                        LayerParameters<Scalar>& gradient);

}  // namespace supple
