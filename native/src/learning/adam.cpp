// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/adam.h"

#include <cmath>

namespace supple {
namespace {

constexpr double kBeta1 = 0.9, kBeta2 = 0.999, kEpsilon = 1e-8;

template <class Gradient, class Values>
void update(const Gradient& gradient, double rate, int steps, Values& mean, Values& square,
            Values& values) {
  using Scalar = typename Values::Scalar;
  const auto b1 = static_cast<Scalar>(kBeta1), b2 = static_cast<Scalar>(kBeta2);
  const auto correct1 = static_cast<Scalar>(1.0 / (1.0 - std::pow(kBeta1, steps)));
  const auto correct2 = static_cast<Scalar>(1.0 / (1.0 - std::pow(kBeta2, steps)));
  mean.array() = b1 * mean.array() + (Scalar(1) - b1) * gradient.array();
  square.array() = b2 * square.array() + (Scalar(1) - b2) * gradient.array().square();
  values.array() -= static_cast<Scalar>(rate) * (correct1 * mean.array()) /
                    ((correct2 * square.array()).sqrt() + static_cast<Scalar>(kEpsilon));
}

}  // namespace

double decayed_learning_rate(double first, double last, int step, int total) {
  return total <= 1 ? first : first * std::pow(last / first, double(step) / (total - 1));
}

template <class Scalar>
Adam<Scalar>::Adam(const LayerSizes& sizes)
    : mean_(LayerParameters<Scalar>::zeros(sizes)),
      square_(LayerParameters<Scalar>::zeros(sizes)) {}

template <class Scalar>
void Adam<Scalar>::step(const LayerParameters<Scalar>& gradient, double learning_rate,
                        LayerParameters<Scalar>& parameters) {
  ++steps_;
  for (size_t l = 0; l < gradient.weights.size(); ++l) {
    update(gradient.weights[l], learning_rate, steps_, mean_.weights[l], square_.weights[l],
           parameters.weights[l]);
    update(gradient.biases[l], learning_rate, steps_, mean_.biases[l], square_.biases[l],
           parameters.biases[l]);
  }
}

template class Adam<float>;
template class Adam<double>;

}  // namespace supple
