// SPDX-License-Identifier: GPL-3.0-or-later
// Handles, targets and editors for tests.
#pragma once

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "native/learning/networks.h"
#include "supple/tasks/edit.h"

namespace supple::test {

inline Eigen::Matrix4d affine(const Matrix3& linear, const Eigen::RowVector3d& offset) {
  // Rows are transformed here, columns by a handle's matrix.
  Eigen::Matrix4d result = Eigen::Matrix4d::Identity();
  result.topLeftCorner<3, 3>() = linear.transpose();
  result.topRightCorner<3, 1>() = offset.transpose();
  return result;
}

/// The `count` vertices nearest to `place`.
inline Handle handle_at(const std::string& name, const Points& points,
                        const Eigen::RowVector3d& place, int count) {
  std::vector<int> order(static_cast<size_t>(points.rows()));
  for (int i = 0; i < points.rows(); ++i) {
    order[static_cast<size_t>(i)] = i;
  }
  const Eigen::VectorXd distance = (points.rowwise() - place).rowwise().squaredNorm();
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return distance[a] < distance[b]; });
  return {name, Eigen::Map<Eigen::VectorXi>(order.data(), count)};
}

inline std::shared_ptr<const PreparedMesh> prepared(const zoo::Mesh& mesh, int eigenfunctions = 32,
                                                    int samples = 200) {
  return std::make_shared<PreparedMesh>(
      mesh.vertices, mesh.faces,
      PrepareOptions{.eigenfunctions = eigenfunctions, .samples = samples});
}

/// An awake network of the rotation signal that fits `prepared`'s defaults above.
inline std::shared_ptr<const LocalJacobianNetwork<float>> editing_network(
    int eigenfunctions = 32, Configuration configuration = Configuration::equivariant,
    double strength = 0.2) {
  const RestMesh<float> rest(zoo::perturbed_sphere(2, 3), eigenfunctions, 0);
  const Signal signal = signal_of(SignalKind::rotation, rest, bent(rest.operators.vertices));
  return std::make_shared<LocalJacobianNetwork<float>>(awake_network<float>(
      {.configuration = configuration, .eigenfunctions = eigenfunctions, .width = 32}, 5,
      rest.context, signal, strength));
}

/// Every way to edit: both ends of the slider, what lies between them, and ARAP.
struct Kind {
  std::string name;
  EditOptions options;
};
inline std::vector<Kind> kinds(int passes = EditOptions().passes) {
  return {{"natural", {.passes = passes}},
          {"half stiff", {.stiffness = 0.5, .passes = passes}},
          {"stiff", {.stiffness = 1.0, .passes = passes}},
          {"arap", {.method = EditMethod::arap, .passes = passes}}};
}

/// One handle holds, one turns and moves: an edit that bends.
struct Edit {
  std::vector<Handle> handles;
  std::vector<HandleTarget> targets;
};
inline Edit bending(const Points& vertices, int each = 6) {
  const Eigen::RowVector3d low = vertices.colwise().minCoeff(),
                           high = vertices.colwise().maxCoeff();
  const double size = (high - low).norm();
  Edit edit;
  edit.handles = {handle_at("foot", vertices, low, each), handle_at("hand", vertices, high, each)};
  const Matrix3 turn = rotation(1);
  const Eigen::RowVector3d offset =
      high - high * turn + 0.2 * size * Eigen::RowVector3d(0.3, -0.5, 0.8);
  edit.targets = {{}, {.matrix = affine(turn, offset), .positions = {}}};
  return edit;
}

}  // namespace supple::test
