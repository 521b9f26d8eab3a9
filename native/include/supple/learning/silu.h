// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "supple/core/types.h"

namespace supple {

/// SiLU of biased features (Elfwing, Uchibe and Doya 2018), one pass over memory:
/// hidden (p x c) += bias (1 x c), and returns p x c of x / (1 + exp(-x)). To 4 units in the last
/// place for float.
template <class Scalar>
RowMatrix<Scalar> add_bias_and_silu(const Eigen::Matrix<Scalar, 1, Eigen::Dynamic>& bias,
                                    RowMatrix<Scalar>& hidden);

/// p x c: gradient with respect to x from the one with respect to silu(x).
template <class Scalar>
RowMatrix<Scalar> silu_backward(const RowMatrix<Scalar>& x, const RowMatrix<Scalar>& grad);

}  // namespace supple
