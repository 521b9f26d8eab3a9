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

// Weight of the whole mesh's rotation against a face's own: decides only where a face has none.
constexpr double kWhole = 1e-6;

// Frames of projected vertices. Where projection shrinks a face to a point, its normal is rounding:
// 0.
MatrixField coarse_frames(const Points& vertices, const Faces& faces,
                          const Eigen::VectorXd& rest_areas) {
  MatrixField frames = face_frames(vertices, faces);
  const Eigen::VectorXd areas = face_areas(vertices, faces);
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    if (areas[f] < 1e-9 * rest_areas[f]) {
      matrix_at(frames, f).row(2).setZero();
    }
  }
  return frames;
}

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
  return spectral_signal(source, Points(basis.project(source.vertices, count)), coarse_target);
}

Signal spectral_signal(const SurfaceOperators& source, const Points& coarse_source,
                       const Points& coarse_target) {
  const MatrixField from = coarse_frames(coarse_source, source.faces, source.face_areas);
  const MatrixField to = coarse_frames(coarse_target, source.faces, source.face_areas);
  const Eigen::Index m = source.faces.rows();
  // Edges are short and the normal is not: weigh them alike.
  MatrixField gram(m, 9), cross(m, 9);
#pragma omp parallel for schedule(static)
  for (Eigen::Index f = 0; f < m; ++f) {
    Matrix3 weighted = matrix_at(from, f);
    weighted.topRows<2>() /= 2.0 * source.face_areas[f];
    matrix_at(gram, f) = weighted.transpose() * matrix_at(from, f);
    matrix_at(cross, f) = weighted.transpose() * matrix_at(to, f);
  }
  // A piece so small that both projections are a point says nothing: it turns with the whole.
  const Eigen::Matrix<double, 1, 9> sum = source.face_areas.transpose() * cross;
  const Matrix3 overall = closest_rotation(Eigen::Map<const Matrix3>(sum.data()));
  MatrixField coarse(m, 9);
#pragma omp parallel for schedule(static)
  for (Eigen::Index f = 0; f < m; ++f) {
    // Where the projection has flattened a face it says nothing of stretch; there the rotation
    // stands.
    const Matrix3 rotation = closest_rotation(matrix_at(cross, f) + kWhole * overall);
    const Matrix3 regular = matrix_at(gram, f) + kTrust * Matrix3::Identity();
    matrix_at(coarse, f) = regular.inverse() * (matrix_at(cross, f) + kTrust * rotation);
  }
  return {{jacobians(source.inverse_frames, to), std::move(coarse)}};
}

Points spectral_target(const Eigenbasis& source_basis, const Eigenbasis& target_basis,
                       const Points& target, Eigen::Index count) {
  return source_basis.project(target_basis.project(target, count), count);
}

}  // namespace supple
