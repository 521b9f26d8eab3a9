// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/signal.h"

#include <Eigen/LU>

#include "supple/core/error.h"
#include "supple/geometry/jacobians.h"
#include "supple/geometry/rotations.h"

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

// The frame F of a face, weighted. Edges are short and the normal is not: weigh them alike.
Matrix3 weighted(const Matrix3& frame, double rest_area) {
  Matrix3 result = frame;
  result.topRows<2>() /= 2.0 * rest_area;
  return result;
}

// The frames of a coarse source and target, compared face by face.
struct Comparison {
  const SurfaceOperators& source;
  MatrixField from, to;
  MatrixField cross;  // F1^T weighted, times F2
  Matrix3 sum;        // of `cross` by area
  Matrix3 overall;    // its closest rotation: that of the whole mesh

  Comparison(const SurfaceOperators& source_in, const Points& coarse_source,
             const Points& coarse_target)
      : source(source_in),
        from(coarse_frames(coarse_source, source.faces, source.face_areas)),
        to(coarse_frames(coarse_target, source.faces, source.face_areas)),
        cross(from.rows(), 9) {
#pragma omp parallel for schedule(static)
    for (Eigen::Index f = 0; f < cross.rows(); ++f) {
      matrix_at(cross, f) =
          weighted(matrix_at(from, f), source.face_areas[f]).transpose() * matrix_at(to, f);
    }
    Eigen::Map<Eigen::Matrix<double, 1, 9>>(sum.data()) = source.face_areas.transpose() * cross;
    overall = closest_rotation(sum);
  }

  // A piece so small that both projections are a point says nothing: it turns with the whole.
  Matrix3 turning(Eigen::Index f) const { return matrix_at(cross, f) + kWhole * overall; }
  // What the face's second field is solved with: symmetric.
  Matrix3 regular_inverse(Eigen::Index f) const {
    const Matrix3 frame = matrix_at(from, f);
    const Matrix3 gram = weighted(frame, source.face_areas[f]).transpose() * frame;
    return (gram + kTrust * Matrix3::Identity()).inverse();
  }
};

void check(const SurfaceOperators& source, const Points& coarse_source, const Points& coarse_target,
           const Signal& grad) {
  const Eigen::Index n = source.vertices.rows(), m = source.faces.rows();
  if (coarse_source.rows() != n || coarse_target.rows() != n) {
    throw Error(ErrorCode::wrong_shape,
                "The coarse source has " + std::to_string(coarse_source.rows()) +
                    " vertices and the coarse target " + std::to_string(coarse_target.rows()) +
                    "; both need the surface's " + std::to_string(n) + ".");
  }
  if (grad.fields.size() != 2 || grad.fields[0].rows() != m || grad.fields[1].rows() != m) {
    throw Error(ErrorCode::wrong_shape, "The gradient of a spectral signal needs two fields of " +
                                            std::to_string(m) + " rows, one a face.");
  }
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

Signal rotation_signal(const MatrixField& suggested) {
  Signal signal;  // a list in braces would be copied, twice
  signal.fields.push_back(closest_rotations(suggested));
  return signal;
}

Signal spectral_signal(const SurfaceOperators& source, const Eigenbasis& basis,
                       const Points& coarse_target, Eigen::Index count) {
  return spectral_signal(source, Points(basis.project(source.vertices, count)), coarse_target);
}

Signal spectral_signal(const SurfaceOperators& source, const Points& coarse_source,
                       const Points& coarse_target) {
  const Comparison faces(source, coarse_source, coarse_target);
  MatrixField coarse(source.faces.rows(), 9);
#pragma omp parallel for schedule(static)
  for (Eigen::Index f = 0; f < coarse.rows(); ++f) {
    // Where the projection has flattened a face it says nothing of stretch; there the rotation
    // stands.
    const Matrix3 rotation = closest_rotation(faces.turning(f));
    matrix_at(coarse, f) =
        faces.regular_inverse(f) * (matrix_at(faces.cross, f) + kTrust * rotation);
  }
  Signal signal;
  signal.fields.push_back(jacobians(source.inverse_frames, faces.to));
  signal.fields.push_back(std::move(coarse));
  return signal;
}

Points spectral_signal_backward(const SurfaceOperators& source, const Points& coarse_source,
                                const Points& coarse_target, const Signal& grad) {
  check(source, coarse_source, coarse_target, grad);
  const Comparison faces(source, coarse_source, coarse_target);
  const Eigen::Index m = source.faces.rows();
  // With respect to `cross` but for its part in the whole, and to what each face turns with.
  MatrixField grad_cross(m, 9), grad_turning(m, 9);
#pragma omp parallel for schedule(static)
  for (Eigen::Index f = 0; f < m; ++f) {
    const Matrix3 solved = faces.regular_inverse(f) * matrix_at(grad.fields.back(), f);
    matrix_at(grad_turning, f) = closest_rotation_backward(faces.turning(f), kTrust * solved);
    matrix_at(grad_cross, f) = solved + matrix_at(grad_turning, f);
  }
  // kWhole is small, but its derivative is not where a face has no rotation of its own.
  const Eigen::Matrix<double, 1, 9> whole = kWhole * grad_turning.colwise().sum();
  const Matrix3 grad_sum =
      closest_rotation_backward(faces.sum, Eigen::Map<const Matrix3>(whole.data()));
  MatrixField grad_to(m, 9);
#pragma omp parallel for schedule(static)
  for (Eigen::Index f = 0; f < m; ++f) {
    const double area = source.face_areas[f];
    auto frame = matrix_at(grad_to, f);
    frame =
        weighted(matrix_at(faces.from, f), area) * (matrix_at(grad_cross, f) + area * grad_sum) +
        matrix_at(source.inverse_frames, f).transpose() * matrix_at(grad.fields.front(), f);
    if (matrix_at(faces.to, f).row(2).isZero(0.0)) {
      frame.row(2).setZero();  // `coarse_frames` left this face without a normal
    }
  }
  return face_frames_backward(coarse_target, source.faces, grad_to);
}

Points spectral_target(const Eigenbasis& source_basis, const Eigenbasis& target_basis,
                       const Points& target, Eigen::Index count) {
  return source_basis.project(target_basis.project(target, count), count);
}

}  // namespace supple
