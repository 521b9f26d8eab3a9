// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>
#include <vector>

#include "supple/learning/spectral_mlp.h"

namespace supple {

/// The paper's schedule: from `first` at step 0 down to `last` at step total - 1. The paper says
/// "decayed progressively"; here by the same factor every step.
double decayed_learning_rate(double first, double last, int step, int total);

/// Adam (Kingma and Ba 2015), beta 0.9 and 0.999, epsilon 1e-8, bias-corrected, no weight decay.
template <class Scalar>
class Adam {
 public:
  /// For tensors of so many numbers each.
  explicit Adam(const std::vector<Eigen::Index>& counts);
  explicit Adam(const LayerSizes& sizes);
  /// gradient, values: a span for each tensor, in the constructor's order. Errors: `wrong_shape`.
  void step(const std::vector<std::span<const Scalar>>& gradient, double learning_rate,
            const std::vector<std::span<Scalar>>& values);
  void step(const LayerParameters<Scalar>& gradient, double learning_rate,
            LayerParameters<Scalar>& parameters);

  /// All that the next step depends on besides its arguments.
  struct State {
    std::vector<RowMatrix<Scalar>> mean, square;  ///< of the gradient, 1 x numbers for each tensor
    int steps = 0;
  };
  const State& state() const { return state_; }
  /// Goes on from a state that `state` returned. Errors: `wrong_shape` for that of other tensors.
  void restore(State state);

 private:
  State state_;
};

}  // namespace supple
