// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/tasks/blending.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <queue>
#include <string>
#include <utility>
#include <vector>

#include "supple/core/error.h"

namespace supple {

Points blend(const Points& rest, const Points& posed, double strength,
             const Eigen::VectorXd& weights) {
  if (posed.rows() != rest.rows() || (weights.size() > 0 && weights.size() != rest.rows())) {
    throw Error(ErrorCode::wrong_shape, "There are " + std::to_string(rest.rows()) +
                                            " rest vertices, " + std::to_string(posed.rows()) +
                                            " posed ones and " + std::to_string(weights.size()) +
                                            " weights; all must be as many.");
  }
  if (!std::isfinite(strength)) {
    throw Error(ErrorCode::not_finite, "The strength is not a finite number.");
  }
  if (weights.size() == 0) {
    // At 1 the pose itself, to the last bit.
    return strength == 1.0 ? posed : Points(rest + strength * (posed - rest));
  }
  return rest + (strength * weights).asDiagonal() * (posed - rest);
}

Eigen::VectorXd falloff_weights(const SurfaceOperators& operators, const Eigen::VectorXi& vertices,
                                double radius) {
  const Eigen::Index n = operators.vertices.rows();
  if (!(radius > 0.0)) {
    throw Error(ErrorCode::bad_option,
                "The falloff radius is " + std::to_string(radius) + "; it must be above 0.");
  }
  Eigen::VectorXd distance = Eigen::VectorXd::Constant(n, std::numeric_limits<double>::infinity());
  using Entry = std::pair<double, int>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  for (const int vertex : vertices) {
    if (vertex < 0 || vertex >= n) {
      throw Error(ErrorCode::index_out_of_range, "Vertex " + std::to_string(vertex) +
                                                     " is not in a surface of " +
                                                     std::to_string(n) + " vertices.");
    }
    distance[vertex] = 0.0;
    open.emplace(0.0, vertex);
  }
  while (!open.empty()) {
    const auto [so_far, vertex] = open.top();
    open.pop();
    if (so_far > distance[vertex] || so_far >= radius) {
      continue;
    }
    for (int i = operators.corners.first[vertex]; i < operators.corners.first[vertex + 1]; ++i) {
      const auto face = operators.faces.row(operators.corners.corner[i] / 3);
      for (const int other : face) {
        const double length =
            so_far + (operators.vertices.row(other) - operators.vertices.row(vertex)).norm();
        if (length < distance[other]) {
          distance[other] = length;
          open.emplace(length, other);
        }
      }
    }
  }
  return distance.unaryExpr([radius](double d) {
    const double t = std::max(0.0, 1.0 - d / radius);
    return t * t * (3.0 - 2.0 * t);
  });
}

}  // namespace supple
