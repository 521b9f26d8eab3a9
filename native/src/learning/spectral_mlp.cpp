// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/spectral_mlp.h"

#include <cmath>
#include <random>

#include "supple/core/dense.h"
#include "supple/core/error.h"
#include "supple/learning/silu.h"
#include "tensors.h"

namespace supple {
template <class Scalar>
LayerParameters<Scalar> LayerParameters<Scalar>::zeros(const LayerSizes& sizes) {
  LayerParameters result;
  for (int l = 0; l < sizes.count(); ++l) {
    result.weights.push_back(RowMatrix<Scalar>::Zero(sizes.rows(l), sizes.cols(l)));
    result.biases.push_back(Eigen::Matrix<Scalar, 1, Eigen::Dynamic>::Zero(sizes.cols(l)));
  }
  return result;
}

template <class Scalar>
LayerParameters<Scalar> LayerParameters<Scalar>::random(const LayerSizes& sizes, uint64_t seed,
                                                        double last_gain) {
  LayerParameters result = zeros(sizes);
  std::mt19937_64 generator(seed);
  for (int l = 0; l < sizes.count(); ++l) {
    const double gain = l == sizes.count() - 1 ? last_gain : 1.0;
    const double bound = gain * std::sqrt(6.0 / (sizes.rows(l) + sizes.cols(l)));
    fill_uniform(generator, bound, result.weights[l]);
  }
  return result;
}

template <class Scalar>
template <class Other>
LayerParameters<Other> LayerParameters<Scalar>::cast() const {
  LayerParameters<Other> result;
  for (const auto& w : weights) {
    result.weights.push_back(w.template cast<Other>());
  }
  for (const auto& b : biases) {
    result.biases.push_back(b.template cast<Other>());
  }
  return result;
}

template <class Scalar>
RowMatrix<Scalar> spectral_mlp_forward(const LayerSizes& sizes,
                                       const LayerParameters<Scalar>& parameters,
                                       const SpectralDomain<Scalar>& domain,
                                       const RowMatrix<Scalar>& input,
                                       SpectralMlpTrace<Scalar>* trace) {
  if (input.cols() != sizes.inputs || input.rows() != domain.functions.rows()) {
    throw Error(ErrorCode::wrong_shape,
                "The network takes " + std::to_string(domain.functions.rows()) + " x " +
                    std::to_string(sizes.inputs) + " inputs, not " + std::to_string(input.rows()) +
                    " x " + std::to_string(input.cols()) + ".");
  }
  if (trace != nullptr) {
    *trace = {};
    trace->input = input;
  }
  RowMatrix<Scalar> hidden, spectral;
  for (int l = 0; l <= sizes.projected; ++l) {
    hidden = l == 0 ? product(input, parameters.weights[0])
                    : product(domain.functions, product(spectral, parameters.weights[l]));
    RowMatrix<Scalar> active = add_bias_and_silu(parameters.biases[l], hidden);
    if (trace != nullptr) {
      trace->preactivation.push_back(std::move(hidden));
    }
    if (l < sizes.projected) {
      spectral = product(domain.projector, active);
      if (trace != nullptr) {
        trace->spectral.push_back(spectral);
      }
    } else {
      hidden = std::move(active);
    }
  }
  RowMatrix<Scalar> output = product(hidden, parameters.weights.back());
  output.rowwise() += parameters.biases.back();
  if (trace != nullptr) {
    trace->last = std::move(hidden);
  }
  return output;
}

template <class Scalar>
RowMatrix<Scalar> spectral_mlp_backward(const LayerSizes& sizes,
                                        const LayerParameters<Scalar>& parameters,
                                        const SpectralDomain<Scalar>& domain,
                                        const SpectralMlpTrace<Scalar>& trace,
                                        const RowMatrix<Scalar>& grad_output,
                                        LayerParameters<Scalar>& gradient) {
  const Scalar one(1);
  gemm(one, trace.last, Op::transpose, grad_output, Op::none, one, gradient.weights.back());
  gradient.biases.back() += grad_output.colwise().sum();
  RowMatrix<Scalar> grad_active =
      product(grad_output, Op::none, parameters.weights.back(), Op::transpose);
  for (int l = sizes.projected; l >= 0; --l) {
    const RowMatrix<Scalar> grad_hidden = silu_backward(trace.preactivation[l], grad_active);
    gradient.biases[l] += grad_hidden.colwise().sum();
    if (l == 0) {
      gemm(one, trace.input, Op::transpose, grad_hidden, Op::none, one, gradient.weights[0]);
      return product(grad_hidden, Op::none, parameters.weights[0], Op::transpose);
    }
    const RowMatrix<Scalar> grad_mixed =
        product(domain.functions, Op::transpose, grad_hidden, Op::none);
    gemm(one, trace.spectral[l - 1], Op::transpose, grad_mixed, Op::none, one, gradient.weights[l]);
    const RowMatrix<Scalar> grad_spectral =
        product(grad_mixed, Op::none, parameters.weights[l], Op::transpose);
    grad_active = product(domain.projector, Op::transpose, grad_spectral, Op::none);
  }
  return {};  // not reached: the loop returns at layer 0
}

#define SUPPLE_INSTANTIATE(Scalar)                                                      \
  template struct LayerParameters<Scalar>;                                              \
  template RowMatrix<Scalar> spectral_mlp_forward<Scalar>(                              \
      const LayerSizes&, const LayerParameters<Scalar>&, const SpectralDomain<Scalar>&, \
      const RowMatrix<Scalar>&, SpectralMlpTrace<Scalar>*);                             \
  template RowMatrix<Scalar> spectral_mlp_backward<Scalar>(                             \
      const LayerSizes&, const LayerParameters<Scalar>&, const SpectralDomain<Scalar>&, \
      const SpectralMlpTrace<Scalar>&, const RowMatrix<Scalar>&, LayerParameters<Scalar>&);
SUPPLE_INSTANTIATE(float)
SUPPLE_INSTANTIATE(double)
#undef SUPPLE_INSTANTIATE
template LayerParameters<double> LayerParameters<float>::cast<double>() const;
template LayerParameters<float> LayerParameters<double>::cast<float>() const;
template LayerParameters<float> LayerParameters<float>::cast<float>() const;
template LayerParameters<double> LayerParameters<double>::cast<double>() const;

}  // namespace supple
