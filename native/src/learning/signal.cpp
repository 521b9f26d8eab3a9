// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/signal.h"

#include <cmath>

#include "supple/core/error.h"
#include "supple/geometry/jacobians.h"

namespace supple {

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
  MatrixField rotations(source.faces.rows(), 9);
#pragma omp parallel for schedule(static)
  for (Eigen::Index f = 0; f < source.faces.rows(); ++f) {
    // Edges are short and the normal is not: weigh them alike (Kabsch).
    Matrix3 weighted = matrix_at(from, f);
    weighted.topRows<2>() /= 2.0 * source.face_areas[f];
    matrix_at(rotations, f) = closest_rotation(weighted.transpose() * matrix_at(to, f));
  }
  return {{source.jacobians_of(coarse_target), std::move(rotations)}};
}

Points spectral_target(const Eigenbasis& source_basis, const Eigenbasis& target_basis,
                       const Points& target, Eigen::Index count) {
  return source_basis.project(target_basis.project(target, count), count);
}

}  // namespace supple
