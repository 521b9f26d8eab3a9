// SPDX-License-Identifier: GPL-3.0-or-later
// Weights: their first values, and by name, as model files have them.
#pragma once

#include <map>
#include <random>
#include <string>

#include "supple/core/error.h"
#include "supple/core/types.h"

namespace supple {

/// Uniform in [-bound, bound), the same on every platform.
template <class Scalar>
void fill_uniform(std::mt19937_64& generator, double bound, RowMatrix<Scalar>& values) {
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    // 53 random bits by hand: std::uniform_real_distribution differs between libraries.
    const double unit = static_cast<double>(generator() >> 11) * 0x1.0p-53;
    values.data()[i] = static_cast<Scalar>(bound * (2.0 * unit - 1.0));
  }
}

/// Errors: `model_file` where the tensor is missing, has another shape, or is not finite.
template <class Scalar>
RowMatrix<Scalar> read_tensor(const std::map<std::string, RowMatrix<float>>& tensors,
                              const std::string& name, Eigen::Index rows, Eigen::Index cols) {
  const auto found = tensors.find(name);
  if (found == tensors.end()) {
    throw Error(ErrorCode::model_file,
                "The weights have no tensor '" + name +
                    "'. They are not a Supple network of this architecture.");
  }
  const RowMatrix<float>& value = found->second;
  if (value.rows() != rows || value.cols() != cols) {
    throw Error(ErrorCode::model_file,
                "The weights' tensor '" + name + "' is " + std::to_string(value.rows()) + " x " +
                    std::to_string(value.cols()) + ", not " + std::to_string(rows) + " x " +
                    std::to_string(cols) + ". They belong to another architecture.");
  }
  if (!value.allFinite()) {
    throw Error(ErrorCode::model_file,
                "The weights' tensor '" + name + "' has numbers that are not finite.");
  }
  return value.template cast<Scalar>();
}

}  // namespace supple
