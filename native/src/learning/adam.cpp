// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/adam.h"

#include <cmath>
#include <utility>

#include "supple/core/error.h"

namespace supple {
namespace {

constexpr double kBeta1 = 0.9, kBeta2 = 0.999, kEpsilon = 1e-8;

template <class Matrix>
auto numbers(Matrix& matrix) {
  return std::span(matrix.data(), static_cast<size_t>(matrix.size()));
}

// The numbers of every layer, its weights before its bias.
template <class Number, class Parameters>
std::vector<std::span<Number>> layers(Parameters& parameters) {
  std::vector<std::span<Number>> result;
  for (size_t l = 0; l < parameters.weights.size(); ++l) {
    result.push_back(numbers(parameters.weights[l]));
    result.push_back(numbers(parameters.biases[l]));
  }
  return result;
}

std::vector<Eigen::Index> layer_counts(const LayerSizes& sizes) {
  std::vector<Eigen::Index> counts;
  for (int l = 0; l < sizes.count(); ++l) {
    counts.push_back(Eigen::Index(sizes.rows(l)) * sizes.cols(l));
    counts.push_back(sizes.cols(l));
  }
  return counts;
}

}  // namespace

double decayed_learning_rate(double first, double last, int step, int total) {
  return total <= 1 ? first : first * std::pow(last / first, double(step) / (total - 1));
}

template <class Scalar>
Adam<Scalar>::Adam(const std::vector<Eigen::Index>& counts) {
  for (const Eigen::Index count : counts) {
    state_.mean.push_back(RowMatrix<Scalar>::Zero(1, count));
    state_.square.push_back(RowMatrix<Scalar>::Zero(1, count));
  }
}

template <class Scalar>
Adam<Scalar>::Adam(const LayerSizes& sizes) : Adam(layer_counts(sizes)) {}

template <class Scalar>
void Adam<Scalar>::restore(State state) {
  const auto fits = [&](const std::vector<RowMatrix<Scalar>>& given) {
    bool same = given.size() == state_.mean.size();
    for (size_t t = 0; same && t < given.size(); ++t) {
      same = given[t].rows() == 1 && given[t].cols() == state_.mean[t].cols();
    }
    return same;
  };
  if (!fits(state.mean) || !fits(state.square) || state.steps < 0) {
    throw Error(ErrorCode::wrong_shape, "The state of an Adam for other tensors was given.");
  }
  state_ = std::move(state);
}

template <class Scalar>
void Adam<Scalar>::step(const std::vector<std::span<const Scalar>>& gradient, double learning_rate,
                        const std::vector<std::span<Scalar>>& values) {
  auto& [mean, square, steps] = state_;
  bool fits = gradient.size() == mean.size() && values.size() == mean.size();
  for (size_t t = 0; fits && t < mean.size(); ++t) {
    const auto size = static_cast<size_t>(mean[t].size());
    fits = gradient[t].size() == size && values[t].size() == size;
  }
  if (!fits) {
    throw Error(ErrorCode::wrong_shape,
                "The gradient or the parameters are not of the sizes this Adam was made for.");
  }
  ++steps;
  const auto b1 = static_cast<Scalar>(kBeta1), b2 = static_cast<Scalar>(kBeta2);
  const auto correct1 = static_cast<Scalar>(1.0 / (1.0 - std::pow(kBeta1, steps)));
  const auto correct2 = static_cast<Scalar>(1.0 / (1.0 - std::pow(kBeta2, steps)));
  for (size_t t = 0; t < mean.size(); ++t) {
    using Array = Eigen::Array<Scalar, 1, Eigen::Dynamic>;
    const Eigen::Map<const Array> g(gradient[t].data(), mean[t].size());
    Eigen::Map<Array> x(values[t].data(), mean[t].size());
    auto m = mean[t].row(0).array(), v = square[t].row(0).array();
    m = b1 * m + (Scalar(1) - b1) * g;
    v = b2 * v + (Scalar(1) - b2) * g.square();
    x -= static_cast<Scalar>(learning_rate) * (correct1 * m) /
         ((correct2 * v).sqrt() + static_cast<Scalar>(kEpsilon));
  }
}

template <class Scalar>
void Adam<Scalar>::step(const LayerParameters<Scalar>& gradient, double learning_rate,
                        LayerParameters<Scalar>& parameters) {
  step(layers<const Scalar>(gradient), learning_rate, layers<Scalar>(parameters));
}

template class Adam<float>;
template class Adam<double>;

}  // namespace supple
