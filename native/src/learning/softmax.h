// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "supple/core/types.h"

namespace supple {

/// Replaces `count` >= 1 finite numbers x by exp(x / temperature), divided by their sum;
/// temperature > 0. No x is too large: the largest is taken off first. Weights below 1e-304 of the
/// largest come out as about that.
void softmax(double* row, Eigen::Index count, double temperature);

}  // namespace supple
