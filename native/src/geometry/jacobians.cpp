// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/jacobians.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>

#include "supple/core/simd.h"

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

// Cofactors of 3x3 matrices, a vector of lanes a number.
template <class V>
SUPPLE_INLINE void cofactors(const V* q, V* out) {
  for (int i = 0; i < 3; ++i) {
    const int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
    for (int j = 0; j < 3; ++j) {
      const int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      out[3 * i + j] = q[3 * i1 + j1] * q[3 * i2 + j2] - q[3 * i1 + j2] * q[3 * i2 + j1];
    }
  }
}

// Newton's iteration on as many matrices at once as a vector has lanes. With singular values s
// (the last one negative where J is mirrored), J + cofactor(J) has s1 + s2 s3, s2 + s3 s1,
// s3 + s1 s2 in the same directions, so the same closest rotation, but is far from singular even
// where J has rank 2: a few steps do, without scaling. What is not there after kSteps gets NaN and
// is done by itself.
//
// Quadratic: a last change below `done` leaves less than rounding. Of what begins below `singular`,
// rounding would choose the rotation.
template <class Scalar>
struct Limits;
template <>
struct Limits<double> {
  static constexpr double done = 1e-15, singular = 1e-6;
};
template <>
struct Limits<float> {
  static constexpr float done = 1e-8F, singular = 1e-3F;
};

template <class Scalar, int Bytes>
SUPPLE_INLINE void newton(const double* from, double* to, Eigen::Index count) {
  using V = typename Lanes<Scalar, Bytes>::type;
  using Limit = Limits<Scalar>;
  constexpr int kLanes = Lanes<Scalar, Bytes>::count;
  constexpr int kSteps = 9;
  constexpr Scalar kHalf(0.5);
  V q[9] = {}, cofactor[9], change{}, square{}, start{};
  for (int e = 0; e < 9; ++e) {
    for (int l = 0; l < kLanes; ++l) {
      q[e][l] = l < count ? static_cast<Scalar>(from[9 * l + e]) : Scalar(e % 4 == 0);
    }
    square += q[e] * q[e];
  }
  V scale;
  for (int l = 0; l < kLanes; ++l) {
    scale[l] = std::sqrt(Scalar(3) / square[l]);
  }
  for (int e = 0; e < 9; ++e) {
    q[e] *= scale;
  }
  cofactors(q, cofactor);
  for (int e = 0; e < 9; ++e) {
    q[e] = kHalf * (q[e] + cofactor[e]);
  }
  for (int step = 0; step < kSteps; ++step) {
    cofactors(q, cofactor);
    const V determinant = q[0] * cofactor[0] + q[1] * cofactor[1] + q[2] * cofactor[2];
    const V half_inverse = kHalf / determinant;
    start = step == 0 ? determinant : start;
    change = V{};
    for (int e = 0; e < 9; ++e) {
      const V next = kHalf * q[e] + half_inverse * cofactor[e];
      const V moved = next - q[e];
      change += moved * moved;
      q[e] = next;
    }
    bool done = true;
    for (int l = 0; l < kLanes; ++l) {
      done = done && change[l] < Limit::done;
    }
    if (done) {
      break;
    }
  }
  cofactors(q, cofactor);
  const V determinant = q[0] * cofactor[0] + q[1] * cofactor[1] + q[2] * cofactor[2];
  for (int l = 0; l < kLanes && l < count; ++l) {
    const bool good =
        change[l] < Limit::done && start[l] > Limit::singular && determinant[l] > kHalf;
    for (int e = 0; e < 9; ++e) {
      to[9 * l + e] = good ? q[e][l] : std::numeric_limits<double>::quiet_NaN();
    }
  }
}

// As many matrices as a kernel takes: the lanes of the widest vector.
constexpr Eigen::Index kTogether = 8;

SUPPLE_AVX512 void newton_avx512(const double* from, double* to, Eigen::Index count) {
  newton<double, 64>(from, to, count);
}
SUPPLE_AVX2 void newton_avx2(const double* from, double* to, Eigen::Index count) {
  newton<double, 32>(from, to, std::min<Eigen::Index>(count, 4));
  if (count > 4) {
    newton<double, 32>(from + 36, to + 36, count - 4);
  }
}
void newton_plain(const double* from, double* to, Eigen::Index count) {
  for (Eigen::Index i = 0; i < count; i += 2) {
    newton<double, 16>(from + 9 * i, to + 9 * i, count - i);
  }
}
SUPPLE_AVX2 void single_newton_avx2(const double* from, double* to, Eigen::Index count) {
  newton<float, 32>(from, to, count);
}
void single_newton_plain(const double* from, double* to, Eigen::Index count) {
  for (Eigen::Index i = 0; i < count; i += 4) {
    newton<float, 16>(from + 9 * i, to + 9 * i, count - i);
  }
}

}  // namespace

void closest_rotations(const double* jacobians, double* rotations, Eigen::Index count,
                       Precision precision) {
  static const auto full = best_kernel(&newton_avx512, &newton_avx2, &newton_plain);
  static const auto single =
      best_kernel(&single_newton_avx2, &single_newton_avx2, &single_newton_plain);
  const auto kernel = precision == Precision::single ? single : full;
  for (Eigen::Index first = 0; first < count; first += kTogether) {
    const Eigen::Index here = std::min(kTogether, count - first);
    const double* const from = jacobians + 9 * first;
    double* const to = rotations + 9 * first;
    kernel(from, to, here);
    for (Eigen::Index i = 0; i < here; ++i) {
      if (std::isnan(to[9 * i])) {
        Eigen::Map<Matrix3>(to + 9 * i) = closest_rotation(Eigen::Map<const Matrix3>(from + 9 * i));
      }
    }
  }
}

MatrixField closest_rotations(const MatrixField& jacobians) {
  MatrixField rotations(jacobians.rows(), 9);
#pragma omp parallel for schedule(static)
  for (Eigen::Index first = 0; first < jacobians.rows(); first += kTogether) {
    closest_rotations(jacobians.row(first).data(), rotations.row(first).data(),
                      std::min(kTogether, jacobians.rows() - first), Precision::full);
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
