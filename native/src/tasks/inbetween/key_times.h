// SPDX-License-Identifier: GPL-3.0-or-later
// Interpolation in time. K keys, K - 1 steps between them.
#pragma once

#include <array>
#include <vector>

#include "supple/core/types.h"

namespace supple {

/// What the keys count for at a time. The interpolant is x_k + along (x_k+1 - x_k) and a bend, a
/// sum of steps x_j+1 - x_j, which is 0 at both keys and turns the line's ends to the tangents
/// there.
struct KeyWeights {
  Eigen::Index key = 0;  ///< k: the time is between keys k and k + 1
  double along = 0.0;    ///< 0 to 1
  /// Of steps k - 1, k, k + 1; 0 for those that there are not.
  std::array<double, 3> bend = {0.0, 0.0, 0.0};

  /// The interpolant of anything linear that is given at the keys.
  template <class Value>
  Value of(const Value& zero, const auto& at_key) const {
    Value result = zero + (1.0 - along) * at_key(key) + along * at_key(key + 1);
    for (Eigen::Index i = 0; i < 3; ++i) {
      if (const double weight = bend[static_cast<size_t>(i)]; weight != 0.0) {
        result += weight * (at_key(key + i) - at_key(key + i - 1));
      }
    }
    return result;
  }
};

/// Cubic Hermite interpolation: at inner keys the slope of the parabola through a key and its
/// neighbours (Catmull-Rom for unequal times), at the first and the last the slope for which the
/// curve is straight there. Linear where not smooth, and for two keys.
class KeyTimes {
 public:
  /// times: ascending, at least 2.
  KeyTimes(std::vector<double> times, bool smooth) : times_(std::move(times)), smooth_(smooth) {}

  const std::vector<double>& times() const { return times_; }
  /// time: between the first key and the last.
  KeyWeights at(double time) const;

 private:
  double step(Eigen::Index j) const {
    return times_[static_cast<size_t>(j) + 1] - times_[static_cast<size_t>(j)];
  }
  /// Adds `factor` times the tangent at key j to a sum of steps around `weights.key`.
  void add_tangent(Eigen::Index j, double factor, KeyWeights& weights) const;

  std::vector<double> times_;
  bool smooth_;
};

}  // namespace supple
