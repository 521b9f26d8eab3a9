// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/tasks/motion_handles.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <queue>
#include <string>
#include <unordered_map>
#include <utility>

#include "supple/core/error.h"
#include "supple/geometry/jacobians.h"

namespace supple {
namespace {

// Everything here is in units of the surface: the root of its area.
constexpr double kRadius = 0.03;
constexpr double kFirstSpacing = 1.0;
// Less is rounding, not motion.
constexpr double kLeastMotion = 1e-9;
// Displacements that differ by less, as a part, are the same: turning the input must not choose.
constexpr double kTie = 1e-9;

void check(const PreparedMesh& prepared, const Points& moved, int count,
           const std::optional<double>& radius) {
  const Eigen::Index n = prepared.mesh.vertices().rows();
  if (moved.rows() != n) {
    throw Error(ErrorCode::wrong_shape, "The moved mesh has " + std::to_string(moved.rows()) +
                                            " vertices, the source " + std::to_string(n) +
                                            "; they must be the same vertices.");
  }
  for (Eigen::Index v = 0; v < n; ++v) {
    if (!moved.row(v).allFinite()) {
      throw Error(ErrorCode::not_finite, "Moved vertex " + std::to_string(v) +
                                             " has a coordinate that is not a finite number. "
                                             "Repair it.");
    }
  }
  if (count < 1) {
    throw Error(ErrorCode::bad_option,
                "At least 1 handle must be asked for, not " + std::to_string(count) + ".");
  }
  if (radius && !(*radius >= 0.0 && std::isfinite(*radius))) {
    throw Error(ErrorCode::bad_option,
                "The radius of a handle is " + std::to_string(*radius) + "; it must be 0 or more.");
  }
}

// n: how far each vertex is from where the nearest rigid motion of all takes it.
Eigen::VectorXd displacements(const SurfaceOperators& operators, const Points& moved) {
  const Eigen::VectorXd mass = operators.mass / operators.mass.sum();
  const Eigen::RowVector3d from = mass.transpose() * operators.vertices;
  const Eigen::RowVector3d to = mass.transpose() * moved;
  const Points x = operators.vertices.rowwise() - from, y = moved.rowwise() - to;
  const Matrix3 turn = closest_rotation(x.transpose() * mass.asDiagonal() * y);
  return (x * turn - y).rowwise().norm();
}

// The vertices within a distance of one along edges, ascending.
std::vector<int> within(const SurfaceOperators& operators, int centre, double reach) {
  using Entry = std::pair<double, int>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  std::unordered_map<int, double> distance = {{centre, 0.0}};
  open.emplace(0.0, centre);
  while (!open.empty()) {
    const auto [so_far, vertex] = open.top();
    open.pop();
    if (so_far > distance.at(vertex)) {
      continue;
    }
    for (int i = operators.corners.first[vertex]; i < operators.corners.first[vertex + 1]; ++i) {
      for (const int other : operators.faces.row(operators.corners.corner[i] / 3)) {
        const double length =
            so_far + (operators.vertices.row(other) - operators.vertices.row(vertex)).norm();
        const auto known = distance.find(other);
        if (length <= reach && (known == distance.end() || length < known->second)) {
          distance[other] = length;
          open.emplace(length, other);
        }
      }
    }
  }
  std::vector<int> result;
  for (const auto& [vertex, length] : distance) {
    result.push_back(vertex);
  }
  std::sort(result.begin(), result.end());
  return result;
}

// Chooses centres one after another and keeps account of what is still free.
class Search {
 public:
  Search(const SurfaceOperators& operators, Eigen::VectorXd displacement, double radius)
      : operators_(operators),
        displacement_(std::move(displacement)),
        radius_(radius),
        taken_(static_cast<size_t>(displacement_.size()), false),
        out_(taken_) {}

  // All that a spacing leaves room for, until there are `count`.
  void fill(double spacing, size_t count) {
    std::vector<bool> near = out_;
    const auto leave_out = [&near](const std::vector<int>& vertices) {
      for (const int v : vertices) {
        near[static_cast<size_t>(v)] = true;
      }
    };
    for (const int centre : centres_) {
      leave_out(within(operators_, centre, spacing));
    }
    for (int centre; patches_.size() < count && (centre = farthest(near)) >= 0;) {
      std::vector<int> patch = within(operators_, centre, radius_);
      near[static_cast<size_t>(centre)] = true;
      if (touches(patch)) {
        out_[static_cast<size_t>(centre)] = true;  // and so it will for every smaller spacing
        continue;
      }
      for (const int v : patch) {
        taken_[static_cast<size_t>(v)] = true;
        out_[static_cast<size_t>(v)] = true;
      }
      leave_out(patch);
      leave_out(within(operators_, centre, spacing));
      centres_.push_back(centre);
      patches_.push_back(std::move(patch));
    }
  }
  // Whether a vertex is left that a smaller spacing might allow.
  bool room() const { return farthest(out_) >= 0; }
  const std::vector<std::vector<int>>& patches() const { return patches_; }

 private:
  // The vertex that moves farthest of those not left out; -1 where none is.
  int farthest(const std::vector<bool>& left_out) const {
    int best = -1;
    for (int v = 0; v < displacement_.size(); ++v) {
      if (!left_out[static_cast<size_t>(v)] &&
          (best < 0 || displacement_[v] > displacement_[best] * (1.0 + kTie))) {
        best = v;
      }
    }
    return best;
  }
  // Whether a patch shares a vertex or an edge with those before.
  bool touches(const std::vector<int>& patch) const {
    const CornerTable& corners = operators_.corners;
    return std::any_of(patch.begin(), patch.end(), [&](int v) {
      for (int i = corners.first[v]; i < corners.first[v + 1]; ++i) {
        for (const int other : operators_.faces.row(corners.corner[i] / 3)) {
          if (taken_[static_cast<size_t>(other)]) {
            return true;
          }
        }
      }
      return false;
    });
  }

  const SurfaceOperators& operators_;
  Eigen::VectorXd displacement_;
  double radius_;
  std::vector<bool> taken_, out_;  // in a patch; no centre, whatever the spacing
  std::vector<int> centres_;
  std::vector<std::vector<int>> patches_;
};

}  // namespace

std::vector<Eigen::VectorXi> propose_motion_handles(const PreparedMesh& prepared,
                                                    const Points& moved, int count,
                                                    std::optional<double> radius) {
  check(prepared, moved, count, radius);
  const TriangleMesh& mesh = prepared.mesh;
  const SurfaceOperators& operators = prepared.operators;
  const Points target = mesh.to_surface(moved)(mesh.mesh_vertex(), Eigen::all);
  Eigen::VectorXd displacement = displacements(operators, target);
  if (!(displacement.maxCoeff() > kLeastMotion)) {
    throw Error(ErrorCode::no_handles,
                "Between the two meshes nothing moves but the whole, rigidly. Give a pose that "
                "differs.");
  }
  Search search(operators, std::move(displacement), radius ? *radius / mesh.scale() : kRadius);
  const auto wanted = static_cast<size_t>(count);
  for (double spacing = kFirstSpacing; search.patches().size() < wanted && search.room();
       spacing *= 0.5) {
    search.fill(spacing, wanted);
  }
  std::vector<Eigen::VectorXi> handles;
  for (const std::vector<int>& patch : search.patches()) {
    Eigen::VectorXi handle(static_cast<Eigen::Index>(patch.size()));
    for (Eigen::Index i = 0; i < handle.size(); ++i) {
      handle[i] = mesh.mesh_vertex()[patch[static_cast<size_t>(i)]];
    }
    handles.push_back(std::move(handle));  // ascending, as surface vertices are in the mesh's order
  }
  return handles;
}

}  // namespace supple
