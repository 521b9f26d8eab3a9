// SPDX-License-Identifier: GPL-3.0-or-later
#include "block.h"

#include "rows.h"
#include "supple/learning/silu.h"

namespace supple::diffusion {
namespace {

// exp(-lambda t), k x width.
template <class Scalar>
RowMatrix<Scalar> decay(const DiffusionContext<Scalar>& context, const RowMatrix<Scalar>& times) {
  return (-(context.values * times)).array().exp().matrix();
}

// i g and its transpose -i g, for 2n x c complex numbers: real parts above imaginary parts.
template <class Scalar>
RowMatrix<Scalar> quarter_turn(const RowMatrix<Scalar>& g, Scalar sign) {
  const Eigen::Index n = g.rows() / 2;
  RowMatrix<Scalar> result(2 * n, g.cols());
  result.topRows(n) = -sign * g.bottomRows(n);
  result.bottomRows(n) = sign * g.topRows(n);
  return result;
}

// tanh(Re(conj(g) b)) of 2n x c numbers each, n x c.
template <class Scalar>
RowMatrix<Scalar> products_forward(const RowMatrix<Scalar>& g, const RowMatrix<Scalar>& b) {
  const Eigen::Index n = g.rows() / 2;
  RowMatrix<Scalar> result(n, g.cols());
#pragma omp parallel for schedule(static)
  for (Eigen::Index i = 0; i < n; ++i) {
    result.row(i).array() =
        (g.row(i).array() * b.row(i).array() + g.row(n + i).array() * b.row(n + i).array()).tanh();
  }
  return result;
}

// From the gradient n x c with respect to the products, the one with respect to g, b apart, and the
// one with respect to b.
template <class Scalar>
void products_backward(const RowMatrix<Scalar>& g, const RowMatrix<Scalar>& b,
                       const RowMatrix<Scalar>& products, const RowMatrix<Scalar>& grad,
                       RowMatrix<Scalar>& grad_g, RowMatrix<Scalar>& grad_b) {
  const Eigen::Index n = products.rows();
  grad_g.resize(2 * n, g.cols());
  grad_b.resize(2 * n, g.cols());
#pragma omp parallel for schedule(static)
  for (Eigen::Index i = 0; i < 2 * n; ++i) {
    const auto of = products.row(i % n).array();
    const auto slope = grad.row(i % n).array() * (Scalar(1) - of * of);
    grad_g.row(i).array() = slope * b.row(i).array();
    grad_b.row(i).array() = slope * g.row(i).array();
  }
}

}  // namespace

template <class Scalar>
RowMatrix<Scalar> block_forward(const typename DiffusionParameters<Scalar>::Block& block,
                                const DiffusionContext<Scalar>& context,
                                typename DiffusionTrace<Scalar>::Block& trace) {
  trace.spectral =
      transposed_times(context.weighted, trace.input).cwiseProduct(decay(context, block.times));
  trace.diffused = times(context.functions, trace.spectral);
  trace.gradients = times<Scalar>(context.gradient, trace.diffused);
  trace.mapped = times(trace.gradients, block.real) +
                 times(quarter_turn(trace.gradients, Scalar(1)), block.imaginary);
  trace.products = products_forward(trace.gradients, trace.mapped);

  using Row = Eigen::Matrix<Scalar, 1, Eigen::Dynamic>;
  const TallPieces<Scalar> together{trace.input, trace.diffused, trace.products};
  for (size_t l = 0; l < 2; ++l) {
    const auto& layer = block.layers[l];
    trace.before[l] =
        l == 0 ? times<Scalar>(together, layer.weight) : times(trace.activated[0], layer.weight);
    trace.activated[l] = add_bias_and_silu<Scalar>(Row(layer.bias), trace.before[l]);
  }
  RowMatrix<Scalar> output = trace.input + times(trace.activated[1], block.layers[2].weight);
  output.rowwise() += Row(block.layers[2].bias);
  return output;
}

template <class Scalar>
RowMatrix<Scalar> block_backward(const typename DiffusionParameters<Scalar>::Block& block,
                                 const DiffusionContext<Scalar>& context,
                                 const typename DiffusionTrace<Scalar>::Block& trace,
                                 const RowMatrix<Scalar>& grad_output,
                                 typename DiffusionParameters<Scalar>::Block& gradient) {
  RowMatrix<Scalar> grad = grad_output;
  for (size_t l = 2; l > 0; --l) {
    grad = linear_backward<Scalar>(block.layers[l], {trace.activated[l - 1]}, grad,
                                   gradient.layers[l]);
    grad = silu_backward(trace.before[l - 1], grad);
  }
  grad = linear_backward<Scalar>(block.layers[0], {trace.input, trace.diffused, trace.products},
                                 grad, gradient.layers[0]);
  const Eigen::Index width = trace.input.cols();
  RowMatrix<Scalar> grad_input = grad_output + grad.leftCols(width);
  RowMatrix<Scalar> grad_diffused = grad.middleCols(width, width);

  RowMatrix<Scalar> grad_gradients, grad_mapped;
  products_backward<Scalar>(trace.gradients, trace.mapped, trace.products, grad.rightCols(width),
                            grad_gradients, grad_mapped);
  gradient.real += transposed_times(trace.gradients, grad_mapped);
  // A number and i times it are at right angles: the diagonal has no effect. Rounding would leave
  // it a slope, and Adam takes steps of full length along any.
  RowMatrix<Scalar> grad_imaginary =
      transposed_times(quarter_turn(trace.gradients, Scalar(1)), grad_mapped);
  grad_imaginary.diagonal().setZero();
  gradient.imaginary += grad_imaginary;
  grad_gradients += times<Scalar>(grad_mapped, RowMatrix<Scalar>(block.real.transpose()));
  grad_gradients += times<Scalar>(quarter_turn(grad_mapped, Scalar(-1)),
                                  RowMatrix<Scalar>(block.imaginary.transpose()));
  grad_diffused += times<Scalar>(context.gradient_transpose, grad_gradients);

  const RowMatrix<Scalar> grad_spectral = transposed_times(context.functions, grad_diffused);
  gradient.times -= context.values.transpose() * grad_spectral.cwiseProduct(trace.spectral);
  grad_input +=
      times<Scalar>(context.weighted, grad_spectral.cwiseProduct(decay(context, block.times)));
  return grad_input;
}

#define SUPPLE_INSTANTIATE(Scalar)                                                            \
  template RowMatrix<Scalar> block_forward<Scalar>(const DiffusionParameters<Scalar>::Block&, \
                                                   const DiffusionContext<Scalar>&,           \
                                                   DiffusionTrace<Scalar>::Block&);           \
  template RowMatrix<Scalar> block_backward<Scalar>(                                          \
      const DiffusionParameters<Scalar>::Block&, const DiffusionContext<Scalar>&,             \
      const DiffusionTrace<Scalar>::Block&, const RowMatrix<Scalar>&,                         \
      DiffusionParameters<Scalar>::Block&);
SUPPLE_INSTANTIATE(float)
SUPPLE_INSTANTIATE(double)
#undef SUPPLE_INSTANTIATE

}  // namespace supple::diffusion
