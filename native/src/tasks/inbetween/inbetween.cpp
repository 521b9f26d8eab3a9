// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/tasks/inbetween.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "key_times.h"
#include "placement.h"
#include "supple/core/error.h"
#include "supple/geometry/rotations.h"
#include "turns.h"

namespace supple {
namespace {

void check_poses(const std::vector<Points>& poses, Eigen::Index n) {
  for (size_t k = 0; k < poses.size(); ++k) {
    const std::string which = "Pose " + std::to_string(k);
    if (poses[k].rows() != n) {
      throw Error(ErrorCode::wrong_shape, which + " has " + std::to_string(poses[k].rows()) +
                                              " vertices, the mesh " + std::to_string(n) +
                                              "; they must be the same vertices.");
    }
    for (Eigen::Index v = 0; v < n; ++v) {
      if (!poses[k].row(v).allFinite()) {
        throw Error(ErrorCode::not_finite, which + ": vertex " + std::to_string(v) +
                                               " has a coordinate that is not a finite number. "
                                               "Repair the pose.");
      }
    }
  }
}

void check_times(const std::vector<double>& times, size_t poses) {
  if (poses < 2 || times.size() != poses) {
    throw Error(ErrorCode::wrong_shape, "There are " + std::to_string(poses) + " poses and " +
                                            std::to_string(times.size()) +
                                            " times; give at least 2, and one time a pose.");
  }
  for (size_t k = 0; k < times.size(); ++k) {
    if (!std::isfinite(times[k])) {
      throw Error(ErrorCode::not_finite,
                  "Time " + std::to_string(k) + " is not a finite number. Give each pose its own.");
    }
    if (k > 0 && !(times[k] > times[k - 1])) {
      throw Error(ErrorCode::bad_option,
                  "Time " + std::to_string(k) + " (" + std::to_string(times[k]) +
                      ") is not after the one before (" + std::to_string(times[k - 1]) +
                      "). Sort the poses by time, and keep one of each.");
    }
  }
}

}  // namespace

struct Inbetween::Impl {
  std::shared_ptr<const PreparedMesh> prepared;
  std::vector<Points> poses;
  KeyTimes times;
  std::vector<MatrixField> rotations, stretches;  // a key
  std::vector<Points> turns;                      // a step: rotation vectors
  std::unique_ptr<const Placement> placement;

  Impl(std::shared_ptr<const PreparedMesh> prepared_in, std::vector<Points> poses_in,
       KeyTimes times_in, const ProgressRange& progress)
      : prepared(std::move(prepared_in)), poses(std::move(poses_in)), times(std::move(times_in)) {
    const auto keys = static_cast<double>(poses.size());
    std::vector<Points> surface_poses;
    for (const Points& pose : poses) {
      surface_poses.push_back(prepared->mesh.to_surface(pose));
      part(surface_poses.back()(prepared->mesh.mesh_vertex(), Eigen::all));
      progress.report(0.5 * static_cast<double>(surface_poses.size()) / keys);
    }
    placement = std::make_unique<const Placement>(*prepared, surface_poses, rotations);
    const std::vector<int> guides = placement->guides();
    for (size_t k = 0; k + 1 < poses.size(); ++k) {
      turns.push_back(turns_between(prepared->operators, rotations[k], rotations[k + 1], guides));
      progress.report(0.5 + 0.4 * static_cast<double>(k + 1) / keys);
    }
    prepared->pinned();  // so that no frame waits for the factor
    progress.report(1.0);
  }

  // Rotations and stretches, J = W Q, of a pose's n x 3 surface vertices.
  void part(const Points& moved) {
    MatrixField stretch = prepared->operators.jacobians_of(moved);
    rotations.push_back(pose_rotations(prepared->operators, moved, stretch));
#pragma omp parallel for schedule(static)
    for (Eigen::Index f = 0; f < stretch.rows(); ++f) {
      matrix_at(stretch, f) *= matrix_at(std::as_const(rotations.back()), f).transpose();
    }
    stretches.push_back(std::move(stretch));
  }

  // The rotations and the Jacobians between the keys, m x 9 each. A face's rotation goes with even
  // speed from key to key and is turned further by the bend, a rotation vector that is 0 at both:
  // exp(along w) exp(bend). Its velocity at a key is w plus the bend's, so the tangents are met as
  // they are in a vector space; run backwards it is the same path.
  std::pair<MatrixField, MatrixField> between(const KeyWeights& weights) const {
    const auto key = static_cast<size_t>(weights.key);
    const Eigen::Index m = prepared->operators.faces.rows();
    MatrixField turned(m, 9), jacobians(m, 9);
#pragma omp parallel for schedule(static)
    for (Eigen::Index f = 0; f < m; ++f) {
      Eigen::RowVector3d bend(0.0, 0.0, 0.0);
      for (size_t i = 0; i < 3; ++i) {
        if (weights.bend[i] != 0.0) {
          bend += weights.bend[i] * turns[key + i - 1].row(f);
        }
      }
      const Matrix3 rotation = matrix_at(rotations[key], f) *
                               rotation_matrix(weights.along * turns[key].row(f)) *
                               rotation_matrix(bend);
      const Matrix3 stretch = weights.of(Matrix3(Matrix3::Zero()), [&](Eigen::Index k) {
        return matrix_at(stretches[static_cast<size_t>(k)], f);
      });
      matrix_at(turned, f) = rotation;
      matrix_at(jacobians, f) = stretch * rotation;
    }
    return {std::move(turned), std::move(jacobians)};
  }
};

Inbetween::Inbetween(std::shared_ptr<const PreparedMesh> prepared, std::vector<Points> poses,
                     std::vector<double> times, const InbetweenOptions& options,
                     ProgressRange progress) {
  check_times(times, poses.size());
  check_poses(poses, prepared->mesh.vertices().rows());
  impl_ = std::make_unique<const Impl>(std::move(prepared), std::move(poses),
                                       KeyTimes(std::move(times), options.smooth), progress);
}
Inbetween::~Inbetween() = default;
Inbetween::Inbetween(Inbetween&&) noexcept = default;

Points Inbetween::at(double time) const {
  if (!std::isfinite(time)) {
    throw Error(ErrorCode::not_finite, "The time asked for is not a finite number.");
  }
  const std::vector<double>& times = impl_->times.times();
  time = std::clamp(time, times.front(), times.back());
  if (const auto key = std::lower_bound(times.begin(), times.end(), time); *key == time) {
    return impl_->poses[static_cast<size_t>(key - times.begin())];
  }
  const KeyWeights weights = impl_->times.at(time);
  const auto [turned, jacobians] = impl_->between(weights);
  const TriangleMesh& mesh = impl_->prepared->mesh;
  const PinnedLaplacian& poisson = *impl_->prepared->pinned();
  Points moved = poisson.factor().solve(
      poisson.without_pins(impl_->prepared->operators.divergence_of(jacobians)));
  impl_->placement->place(weights, turned, moved);
  Points all(mesh.vertices().rows(), 3);
  all(mesh.mesh_vertex(), Eigen::all) = moved;
  impl_->placement->place_unattached(weights, moved, turned, all);
  return mesh.from_surface(all);
}

}  // namespace supple
