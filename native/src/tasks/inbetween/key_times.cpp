// SPDX-License-Identifier: GPL-3.0-or-later
#include "key_times.h"

#include <algorithm>

namespace supple {

void KeyTimes::add_tangent(Eigen::Index j, double factor, KeyWeights& weights) const {
  const auto last = static_cast<Eigen::Index>(times_.size()) - 1;
  const auto add_speed = [&](Eigen::Index of, double share) {
    weights.bend[static_cast<size_t>(of - weights.key + 1)] += factor * share / step(of);
  };
  const Eigen::Index inner = std::clamp<Eigen::Index>(j, 1, last - 1);
  const double before = step(inner - 1), after = step(inner), both = before + after;
  if (j == inner) {
    add_speed(j - 1, after / both);
    add_speed(j, before / both);
  } else if (j == 0) {  // (3 speed - tangent at the next key) / 2: no curvature at the end
    add_speed(0, 1.5 - 0.5 * after / both);
    add_speed(1, -0.5 * before / both);
  } else {
    add_speed(last - 2, -0.5 * after / both);
    add_speed(last - 1, 1.5 - 0.5 * before / both);
  }
}

KeyWeights KeyTimes::at(double time) const {
  const auto after = std::upper_bound(times_.begin() + 1, times_.end() - 1, time);
  KeyWeights weights;
  weights.key = after - times_.begin() - 1;
  const double length = step(weights.key);
  const double s = (time - times_[static_cast<size_t>(weights.key)]) / length;
  weights.along = s;
  if (smooth_ && times_.size() > 2) {
    // Hermite's functions of the tangents, each taken from the line.
    const double at_start = s * (1.0 - s) * (1.0 - s), at_end = -s * s * (1.0 - s);
    add_tangent(weights.key, at_start * length, weights);
    add_tangent(weights.key + 1, at_end * length, weights);
    weights.bend[1] -= at_start + at_end;
  }
  return weights;
}

}  // namespace supple
