// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/jacobians.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>

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
  Points result = Points::Zero(moved.rows(), 3);
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    const Matrix3 grad_frame = matrix_at(inverse_rest_frames, f).transpose() * matrix_at(grad, f);
    const Eigen::RowVector3d e1 = moved.row(faces(f, 1)) - moved.row(faces(f, 0));
    const Eigen::RowVector3d e2 = moved.row(faces(f, 2)) - moved.row(faces(f, 0));
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

MatrixField closest_rotations(const MatrixField& jacobians) {
  MatrixField rotations(jacobians.rows(), 9);
#pragma omp parallel for schedule(static)
  for (Eigen::Index f = 0; f < jacobians.rows(); ++f) {
    matrix_at(rotations, f) = closest_rotation(matrix_at(jacobians, f));
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
