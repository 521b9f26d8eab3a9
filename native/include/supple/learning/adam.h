// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "supple/learning/spectral_mlp.h"

namespace supple {

/// The paper's schedule: from `first` at step 0 down to `last` at step total - 1. The paper says
/// "decayed progressively"; here by the same factor every step.
double decayed_learning_rate(double first, double last, int step, int total);

/// Adam (Kingma and Ba 2015), beta 0.9 and 0.999, epsilon 1e-8, bias-corrected, no weight decay.
template <class Scalar>
class Adam {
 public:
  explicit Adam(const LayerSizes& sizes);
  void step(const LayerParameters<Scalar>& gradient, double learning_rate,
            LayerParameters<Scalar>& parameters);

 private:
  LayerParameters<Scalar> mean_, square_;
  int steps_ = 0;
};

}  // namespace supple
