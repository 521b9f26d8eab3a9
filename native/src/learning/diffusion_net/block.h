// SPDX-License-Identifier: GPL-3.0-or-later
// One block of the DiffusionNet: see `diffusion_net_forward`.
#pragma once

#include "supple/learning/diffusion_net.h"

namespace supple::diffusion {

/// n x width from `trace.input`, n x width; fills the rest of the trace.
template <class Scalar>
RowMatrix<Scalar> block_forward(const typename DiffusionParameters<Scalar>::Block& block,
                                const DiffusionContext<Scalar>& context,
                                typename DiffusionTrace<Scalar>::Block& trace);

/// Adds to `gradient`; returns the gradient with respect to the block's input.
template <class Scalar>
RowMatrix<Scalar> block_backward(const typename DiffusionParameters<Scalar>::Block& block,
                                 const DiffusionContext<Scalar>& context,
                                 const typename DiffusionTrace<Scalar>::Block& trace,
                                 const RowMatrix<Scalar>& grad_output,
                                 typename DiffusionParameters<Scalar>::Block& gradient);

}  // namespace supple::diffusion
