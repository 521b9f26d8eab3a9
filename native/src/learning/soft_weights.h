// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "supple/core/types.h"

namespace supple {

/// weights = exp((x - largest) / temperature) of `count` numbers x, at most about `largest`;
/// temperature > 0, float or double. Weights below e^-87 (float) or e^-700 come out as about that.
/// x may be where the weights go.
template <class Scalar>
void soft_weights(const Scalar* x, Eigen::Index count, Scalar largest, Scalar temperature,
                  Scalar* weights);

}  // namespace supple
