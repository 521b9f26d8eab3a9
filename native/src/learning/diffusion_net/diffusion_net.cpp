// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/diffusion_net.h"

#include <string>

#include "block.h"
#include "rows.h"
#include "supple/core/error.h"

namespace supple {
namespace {

template <class Scalar>
void check_rows(const RowMatrix<Scalar>& values, const DiffusionContext<Scalar>& context, int cols,
                const char* what) {
  const Eigen::Index n = context.functions.rows();
  if (values.rows() != n || values.cols() != cols) {
    throw Error(ErrorCode::wrong_shape,
                "The DiffusionNet takes " + std::to_string(n) + " x " + std::to_string(cols) + " " +
                    what + " for this surface, not " + std::to_string(values.rows()) + " x " +
                    std::to_string(values.cols()) + ".");
  }
}

// Parameters are read by place from here on.
template <class Scalar>
void check_parameters(const DiffusionSizes& sizes, const DiffusionParameters<Scalar>& parameters,
                      const char* what) {
  const auto expected = DiffusionParameters<Scalar>::zeros(sizes);
  const auto wanted = expected.named(), given = parameters.named();
  for (size_t t = 0; t < wanted.size(); ++t) {
    if (given.size() != wanted.size() || given[t].values->rows() != wanted[t].values->rows() ||
        given[t].values->cols() != wanted[t].values->cols()) {
      throw Error(ErrorCode::wrong_shape,
                  std::string("The ") + what +
                      " of the DiffusionNet are of other sizes, first in '" + wanted[t].name +
                      "'.");
    }
  }
}

}  // namespace

template <class Scalar>
RowMatrix<Scalar> diffusion_net_forward(const DiffusionSizes& sizes,
                                        const DiffusionParameters<Scalar>& parameters,
                                        const DiffusionContext<Scalar>& context,
                                        const RowMatrix<Scalar>& input,
                                        DiffusionTrace<Scalar>* trace) {
  check_parameters(sizes, parameters, "parameters");
  check_rows(input, context, sizes.inputs, "inputs");
  if (trace != nullptr) {
    *trace = {};
    trace->input = input;
  }
  RowMatrix<Scalar> x = diffusion::times(input, parameters.first.weight);
  x.rowwise() += parameters.first.bias.row(0);
  for (const auto& block : parameters.blocks) {
    typename DiffusionTrace<Scalar>::Block kept;
    kept.input = std::move(x);
    x = diffusion::block_forward(block, context, kept);
    if (trace != nullptr) {
      trace->blocks.push_back(std::move(kept));
    }
  }
  RowMatrix<Scalar> output = diffusion::times(x, parameters.last.weight);
  output.rowwise() += parameters.last.bias.row(0);
  if (trace != nullptr) {
    trace->last = std::move(x);
  }
  return output;
}

template <class Scalar>
RowMatrix<Scalar> diffusion_net_backward(const DiffusionSizes& sizes,
                                         const DiffusionParameters<Scalar>& parameters,
                                         const DiffusionContext<Scalar>& context,
                                         const DiffusionTrace<Scalar>& trace,
                                         const RowMatrix<Scalar>& grad_output,
                                         DiffusionParameters<Scalar>& gradient) {
  check_parameters(sizes, parameters, "parameters");
  check_parameters(sizes, gradient, "gradients");
  check_rows(grad_output, context, sizes.outputs, "gradients of the features");
  RowMatrix<Scalar> grad =
      diffusion::linear_backward<Scalar>(parameters.last, {trace.last}, grad_output, gradient.last);
  for (size_t b = parameters.blocks.size(); b > 0; --b) {
    grad = diffusion::block_backward(parameters.blocks[b - 1], context, trace.blocks[b - 1], grad,
                                     gradient.blocks[b - 1]);
  }
  return diffusion::linear_backward<Scalar>(parameters.first, {trace.input}, grad, gradient.first);
}

#define SUPPLE_INSTANTIATE(Scalar)                                                                \
  template RowMatrix<Scalar> diffusion_net_forward<Scalar>(                                       \
      const DiffusionSizes&, const DiffusionParameters<Scalar>&, const DiffusionContext<Scalar>&, \
      const RowMatrix<Scalar>&, DiffusionTrace<Scalar>*);                                         \
  template RowMatrix<Scalar> diffusion_net_backward<Scalar>(                                      \
      const DiffusionSizes&, const DiffusionParameters<Scalar>&, const DiffusionContext<Scalar>&, \
      const DiffusionTrace<Scalar>&, const RowMatrix<Scalar>&, DiffusionParameters<Scalar>&);
SUPPLE_INSTANTIATE(float)
SUPPLE_INSTANTIATE(double)
#undef SUPPLE_INSTANTIATE

}  // namespace supple
