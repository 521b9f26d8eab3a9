// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/jacobians.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>

#include "rotation_lanes.h"

namespace supple {
namespace {

Matrix3 rotation_by_svd(const Matrix3& j) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(j, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d u = svd.matrixU();
  if ((u * svd.matrixV().transpose()).determinant() < 0.0) {
    u.col(2) *= -1.0;
  }
  return u * svd.matrixV().transpose();
}

// Gradient with respect to the vertices, where grad_of(f) is that with respect to face f's frame.
template <class GradFrame>
Points frames_backward(const Points& vertices, const Faces& faces, const GradFrame& grad_of) {
  Points result = Points::Zero(vertices.rows(), 3);
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    const Matrix3 grad_frame = grad_of(f);
    const Eigen::RowVector3d e1 = vertices.row(faces(f, 1)) - vertices.row(faces(f, 0));
    const Eigen::RowVector3d e2 = vertices.row(faces(f, 2)) - vertices.row(faces(f, 0));
    const Eigen::RowVector3d cross = e1.cross(e2);
    const double length = cross.norm();
    Eigen::RowVector3d grad_e1 = grad_frame.row(0), grad_e2 = grad_frame.row(1);
    if (length > 0.0) {
      const Eigen::RowVector3d normal = cross / length;
      const Eigen::RowVector3d grad_normal = grad_frame.row(2);
      const Eigen::RowVector3d grad_cross =
          (grad_normal - normal * normal.dot(grad_normal)) / length;
      grad_e1 += e2.cross(grad_cross);
      grad_e2 += grad_cross.cross(e1);
    }
    result.row(faces(f, 1)) += grad_e1;
    result.row(faces(f, 2)) += grad_e2;
    result.row(faces(f, 0)) -= grad_e1 + grad_e2;
  }
  return result;
}

}  // namespace

MatrixField face_frames(const Points& vertices, const Faces& faces) {
  MatrixField frames(faces.rows(), 9);
#pragma omp parallel for schedule(static)
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    const Eigen::RowVector3d origin = vertices.row(faces(f, 0));
    const Eigen::RowVector3d e1 = vertices.row(faces(f, 1)) - origin;
    const Eigen::RowVector3d e2 = vertices.row(faces(f, 2)) - origin;
    const Eigen::RowVector3d cross = e1.cross(e2);
    const double length = cross.norm();
    auto frame = matrix_at(frames, f);
    frame.row(0) = e1;
    frame.row(1) = e2;
    frame.row(2) = length > 0.0 ? Eigen::RowVector3d(cross / length) : Eigen::RowVector3d::Zero();
  }
  return frames;
}

Points face_frames_backward(const Points& vertices, const Faces& faces, const MatrixField& grad) {
  return frames_backward(vertices, faces,
                         [&](Eigen::Index f) -> Matrix3 { return matrix_at(grad, f); });
}

MatrixField inverse_frames(const MatrixField& frames) {
  MatrixField inverses(frames.rows(), 9);
#pragma omp parallel for schedule(static)
  for (Eigen::Index f = 0; f < frames.rows(); ++f) {
    matrix_at(inverses, f) = matrix_at(frames, f).inverse();
  }
  return inverses;
}

MatrixField jacobians(const MatrixField& inverse_rest_frames, const MatrixField& moved_frames) {
  MatrixField field(moved_frames.rows(), 9);
#pragma omp parallel for schedule(static)
  for (Eigen::Index f = 0; f < moved_frames.rows(); ++f) {
    matrix_at(field, f).noalias() = matrix_at(inverse_rest_frames, f) * matrix_at(moved_frames, f);
  }
  return field;
}

MatrixField jacobians(const MatrixField& inverse_rest_frames, const Points& moved,
                      const Faces& faces) {
  return jacobians(inverse_rest_frames, face_frames(moved, faces));
}

Points jacobians_backward(const MatrixField& inverse_rest_frames, const Points& moved,
                          const Faces& faces, const MatrixField& grad) {
  return frames_backward(moved, faces, [&](Eigen::Index f) -> Matrix3 {
    return matrix_at(inverse_rest_frames, f).transpose() * matrix_at(grad, f);
  });
}

Matrix3 closest_rotation(const Matrix3& j) {
  // Newton's iteration needs an orientation-preserving matrix well away from singular.
  const double size = j.norm();
  if (!(j.determinant() > 1e-9 * size * size * size)) {
    return rotation_by_svd(j);
  }
  Matrix3 q = j;
  for (int iteration = 0; iteration < 20; ++iteration) {
    const Matrix3 inverse = q.inverse();
    const double scale = std::sqrt(inverse.norm() / q.norm());
    const Matrix3 next = 0.5 * (scale * q + inverse.transpose() / scale);
    const double change = (next - q).squaredNorm();
    q = next;
    if (change < 1e-24) {  // quadratic: the next step would change it by less than rounding
      return q;
    }
  }
  return rotation_by_svd(j);
}

namespace {

// On as many matrices at once as a vector has lanes; what is not there gets NaN.
template <int Bytes>
SUPPLE_INLINE void rotations(const double* from, double* to, Eigen::Index count) {
  constexpr int kLanes = Lanes<double, Bytes>::count;
  typename Lanes<double, Bytes>::type q[9] = {};
  bool good[kLanes];
  for (int e = 0; e < 9; ++e) {
    for (int l = 0; l < kLanes; ++l) {
      q[e][l] = l < count ? from[9 * l + e] : double(e % 4 == 0);
    }
  }
  rotation_lanes<double, Bytes>(q, good);
  for (int l = 0; l < kLanes && l < count; ++l) {
    for (int e = 0; e < 9; ++e) {
      to[9 * l + e] = good[l] ? q[e][l] : std::numeric_limits<double>::quiet_NaN();
    }
  }
}

// As many matrices as a kernel takes: the lanes of the widest vector.
constexpr Eigen::Index kTogether = 8;

SUPPLE_AVX512 void rotations_avx512(const double* from, double* to, Eigen::Index count) {
  rotations<64>(from, to, count);
}
SUPPLE_AVX2 void rotations_avx2(const double* from, double* to, Eigen::Index count) {
  rotations<32>(from, to, std::min<Eigen::Index>(count, 4));
  if (count > 4) {
    rotations<32>(from + 36, to + 36, count - 4);
  }
}
void rotations_plain(const double* from, double* to, Eigen::Index count) {
  for (Eigen::Index i = 0; i < count; i += 2) {
    rotations<16>(from + 9 * i, to + 9 * i, count - i);
  }
}

}  // namespace

MatrixField closest_rotations(const MatrixField& jacobians) {
  static const auto kernel = best_kernel(&rotations_avx512, &rotations_avx2, &rotations_plain);
  MatrixField rotations(jacobians.rows(), 9);
#pragma omp parallel for schedule(static)
  for (Eigen::Index first = 0; first < jacobians.rows(); first += kTogether) {
    const Eigen::Index count = std::min(kTogether, jacobians.rows() - first);
    kernel(jacobians.row(first).data(), rotations.row(first).data(), count);
    for (Eigen::Index f = first; f < first + count; ++f) {
      if (std::isnan(rotations(f, 0))) {
        matrix_at(rotations, f) = closest_rotation(matrix_at(jacobians, f));
      }
    }
  }
  return rotations;
}

PolarDecomposition polar_decomposition(const Matrix3& j) {
  PolarDecomposition result;
  result.rotation = closest_rotation(j);
  result.stretch = j * result.rotation.transpose();
  return result;
}

}  // namespace supple
