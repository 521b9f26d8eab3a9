// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <random>
#include <span>

#include "learning/tensors.h"
#include "supple/core/error.h"
#include "supple/learning/diffusion_net.h"

namespace supple {
namespace {

constexpr double kLongest = 0.02;  // of the times a network starts with

// Calls visit(name, tensor) for each, constant or not.
template <class Parameters, class Visit>
void over_tensors(Parameters& parameters, const Visit& visit) {
  const auto layer = [&](const std::string& name, auto& values) {
    visit(name + ".weight", values.weight);
    visit(name + ".bias", values.bias);
  };
  layer("first", parameters.first);
  for (size_t b = 0; b < parameters.blocks.size(); ++b) {
    auto& block = parameters.blocks[b];
    const std::string prefix = "block." + std::to_string(b);
    visit(prefix + ".times", block.times);
    visit(prefix + ".real", block.real);
    visit(prefix + ".imaginary", block.imaginary);
    for (size_t l = 0; l < block.layers.size(); ++l) {
      layer(prefix + ".layer." + std::to_string(l), block.layers[l]);
    }
  }
  layer("last", parameters.last);
}

void check(const DiffusionSizes& sizes) {
  if (sizes.inputs < 1 || sizes.outputs < 1 || sizes.width < 1 || sizes.blocks < 0) {
    throw Error(ErrorCode::bad_option,
                "A DiffusionNet of " + std::to_string(sizes.inputs) + " inputs, " +
                    std::to_string(sizes.outputs) + " outputs, width " +
                    std::to_string(sizes.width) + " and " + std::to_string(sizes.blocks) +
                    " blocks cannot be built. Use 1 or more of each (blocks: 0 or more).");
  }
}

std::vector<Eigen::Index> counts(const DiffusionSizes& sizes) {
  const auto zeros = DiffusionParameters<float>::zeros(sizes);
  std::vector<Eigen::Index> result;
  for (const auto& tensor : zeros.named()) {
    result.push_back(tensor.values->size());
  }
  return result;
}

}  // namespace

template <class Scalar>
DiffusionParameters<Scalar> DiffusionParameters<Scalar>::zeros(const DiffusionSizes& sizes) {
  check(sizes);
  const auto layer = [](Eigen::Index rows, Eigen::Index cols) {
    return Layer{RowMatrix<Scalar>::Zero(rows, cols), RowMatrix<Scalar>::Zero(1, cols)};
  };
  const Eigen::Index width = sizes.width;
  DiffusionParameters result;
  result.first = layer(sizes.inputs, width);
  for (int b = 0; b < sizes.blocks; ++b) {
    result.blocks.push_back({RowMatrix<Scalar>::Zero(1, width),
                             RowMatrix<Scalar>::Zero(width, width),
                             RowMatrix<Scalar>::Zero(width, width),
                             {layer(3 * width, width), layer(width, width), layer(width, width)}});
  }
  result.last = layer(width, sizes.outputs);
  return result;
}

template <class Scalar>
DiffusionParameters<Scalar> DiffusionParameters<Scalar>::random(const DiffusionSizes& sizes,
                                                                uint64_t seed) {
  DiffusionParameters result = zeros(sizes);
  std::mt19937_64 generator(seed);
  const auto fill = [&](RowMatrix<Scalar>& weight) {
    fill_uniform(generator, std::sqrt(6.0 / static_cast<double>(weight.rows() + weight.cols())),
                 weight);
  };
  fill(result.first.weight);
  for (Block& block : result.blocks) {
    fill_uniform(generator, kLongest / 2.0, block.times);
    block.times.array() += static_cast<Scalar>(kLongest / 2.0);
    fill(block.real);
    fill(block.imaginary);
    for (Layer& layer : block.layers) {
      fill(layer.weight);
    }
  }
  fill(result.last.weight);
  return result;
}

template <class Scalar>
DiffusionParameters<Scalar> DiffusionParameters<Scalar>::from_tensors(
    const DiffusionSizes& sizes, const std::map<std::string, RowMatrix<float>>& tensors) {
  DiffusionParameters result = zeros(sizes);
  for (const Named& tensor : result.named()) {
    RowMatrix<Scalar>& values = *tensor.values;
    values = read_tensor<Scalar>(tensors, tensor.name, values.rows(), values.cols());
  }
  for (size_t b = 0; b < result.blocks.size(); ++b) {
    if (result.blocks[b].times.minCoeff() < Scalar(0)) {
      throw Error(ErrorCode::model_file, "The weights' tensor 'block." + std::to_string(b) +
                                             ".times' has a negative diffusion time.");
    }
  }
  return result;
}

template <class Scalar>
std::map<std::string, RowMatrix<float>> DiffusionParameters<Scalar>::tensors() const {
  std::map<std::string, RowMatrix<float>> result;
  for (const ConstNamed& tensor : named()) {
    result[tensor.name] = tensor.values->template cast<float>();
  }
  return result;
}

template <class Scalar>
std::vector<typename DiffusionParameters<Scalar>::Named> DiffusionParameters<Scalar>::named() {
  std::vector<Named> result;
  over_tensors(*this, [&](std::string name, RowMatrix<Scalar>& values) {
    result.push_back({std::move(name), &values});
  });
  return result;
}

template <class Scalar>
std::vector<typename DiffusionParameters<Scalar>::ConstNamed> DiffusionParameters<Scalar>::named()
    const {
  std::vector<ConstNamed> result;
  over_tensors(*this, [&](std::string name, const RowMatrix<Scalar>& values) {
    result.push_back({std::move(name), &values});
  });
  return result;
}

template <class Scalar>
DiffusionAdam<Scalar>::DiffusionAdam(const DiffusionSizes& sizes) : adam_(counts(sizes)) {}

template <class Scalar>
void DiffusionAdam<Scalar>::step(const DiffusionParameters<Scalar>& gradient, double learning_rate,
                                 DiffusionParameters<Scalar>& parameters) {
  std::vector<std::span<const Scalar>> slopes;
  for (const auto& tensor : gradient.named()) {
    slopes.emplace_back(tensor.values->data(), static_cast<size_t>(tensor.values->size()));
  }
  std::vector<std::span<Scalar>> values;
  for (const auto& tensor : parameters.named()) {
    values.emplace_back(tensor.values->data(), static_cast<size_t>(tensor.values->size()));
  }
  adam_.step(slopes, learning_rate, values);
  for (auto& block : parameters.blocks) {
    block.times = block.times.cwiseMax(Scalar(0)).eval();
  }
}

template struct DiffusionParameters<float>;
template struct DiffusionParameters<double>;
template class DiffusionAdam<float>;
template class DiffusionAdam<double>;

}  // namespace supple
