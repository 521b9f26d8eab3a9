// SPDX-License-Identifier: GPL-3.0-or-later
// Derivatives against central differences. Fourth order with Richardson's extrapolation, so that in
// double the difference itself is good to about 1e-10 and 1e-5 is a test of the derivative alone.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <span>

#include "supple/core/types.h"

namespace supple::test {

/// The numbers of a matrix in memory, to be varied or compared.
template <class Matrix>
std::span<double> values_of(Matrix& matrix) {
  return {matrix.data(), static_cast<size_t>(matrix.size())};
}
template <class Matrix>
std::span<const double> values_of(const Matrix& matrix) {
  return {matrix.data(), static_cast<size_t>(matrix.size())};
}

inline double central_difference(const std::function<double()>& value, double& x) {
  const double start = x, h = 1e-3 * std::max(1.0, std::abs(start));
  const auto slope = [&](double step) {
    x = start + step;
    const double above = value();
    x = start - step;
    const double below = value();
    x = start;
    return (above - below) / (2.0 * step);
  };
  return (4.0 * slope(h / 2.0) - slope(h)) / 3.0;
}

/// Passes where `analytic` is the gradient of `value` with respect to `variables`, which `value`
/// reads: each entry to `relative` of its own size, or of 1e-3 of the largest, where it is smaller
/// than that. at_most: how many entries are tried, drawn at random where there are more.
inline ::testing::AssertionResult gradient_matches(const std::function<double()>& value,
                                                   std::span<double> variables,
                                                   std::span<const double> analytic,
                                                   size_t at_most = 200, double relative = 1e-5) {
  if (variables.size() != analytic.size()) {
    return ::testing::AssertionFailure()
           << variables.size() << " variables but " << analytic.size() << " derivatives";
  }
  double largest = 0.0;
  for (const double g : analytic) {
    if (!std::isfinite(g)) {
      return ::testing::AssertionFailure() << "the gradient is not finite";
    }
    largest = std::max(largest, std::abs(g));
  }
  std::mt19937 generator(12345);
  const bool all = variables.size() <= at_most;
  for (size_t t = 0; t < std::min(at_most, variables.size()); ++t) {
    const size_t i = all ? t : generator() % variables.size();
    const double numeric = central_difference(value, variables[i]);
    const double size = std::max({std::abs(numeric), std::abs(analytic[i]), 1e-3 * largest});
    if (std::abs(numeric - analytic[i]) > relative * size + 1e-14) {
      return ::testing::AssertionFailure()
             << "derivative " << i << " of " << variables.size() << " is " << analytic[i]
             << ", differences say " << numeric << " (largest of the gradient: " << largest << ")";
    }
  }
  return ::testing::AssertionSuccess();
}

}  // namespace supple::test
