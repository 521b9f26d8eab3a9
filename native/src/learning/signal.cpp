// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/signal.h"

#include <Eigen/LU>

#include "supple/core/error.h"
#include "supple/geometry/jacobians.h"

namespace supple {
namespace {

// Weight of "the deformation is a rotation" against the frames of the projected source, whose size
// is 1 where projection keeps a face as it is. Chosen on generated pairs; 0.01 to 0.1 differ
// little.
constexpr double kTrust = 0.03;

}  // namespace

const char* to_string(SignalKind kind) {
  return kind == SignalKind::rotation ? "rotation" : "spectral";
}

SignalKind signal_kind(const std::string& name) {
  if (name == "rotation") {
    return SignalKind::rotation;
  }
  if (name == "spectral") {
    return SignalKind::spectral;
  }
  throw Error(ErrorCode::bad_option, "'" + name + "' is no signal. Use 'rotation' or 'spectral'.");
}

int field_count(SignalKind kind) { return kind == SignalKind::rotation ? 1 : 2; }

Signal rotation_signal(const MatrixField& suggested) { return {{closest_rotations(suggested)}}; }

Signal spectral_signal(const SurfaceOperators& source, const Eigenbasis& basis,
                       const Points& coarse_target, Eigen::Index count) {
  const Points coarse_source = basis.project(source.vertices, count);
  const MatrixField from = face_frames(coarse_source, source.faces);
  const MatrixField to = face_frames(coarse_target, source.faces);
  MatrixField coarse(source.faces.rows(), 9);
#pragma omp parallel for schedule(static)
  for (Eigen::Index f = 0; f < source.faces.rows(); ++f) {
    // Edges are short and the normal is not: weigh them alike.
    const double edge_weight = 1.0 / (2.0 * source.face_areas[f]);
    Matrix3 weighted = matrix_at(from, f);
    weighted.topRows<2>() *= edge_weight;
    const Matrix3 gram = weighted.transpose() * matrix_at(from, f);
    const Matrix3 cross = weighted.transpose() * matrix_at(to, f);
    // Where the projection has flattened a face it says nothing of stretch; there the rotation
    // stands.
    const Matrix3 regular = gram + kTrust * Matrix3::Identity();
    matrix_at(coarse, f) = regular.inverse() * (cross + kTrust * closest_rotation(cross));
  }
  return {{source.jacobians_of(coarse_target), std::move(coarse)}};
}

Points spectral_target(const Eigenbasis& source_basis, const Eigenbasis& target_basis,
                       const Points& target, Eigen::Index count) {
  return source_basis.project(target_basis.project(target, count), count);
}

}  // namespace supple
