// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

#include "supple/geometry/jacobians.h"
#include "supple/geometry/mesh.h"

namespace supple {
namespace {

// Below this part of its area a face's distortion goes on along its tangent.
constexpr double kSmallest = 0.1;
// The volume term. A change of a tenth weighs like a mean strain of 0.002: enough to stop a bar
// from folding flat, where with ten times as much a sharp bend would strain more than ARAP's.
constexpr double kVolume = 0.2;
// A fold's faces resist bending this many times more, each time it is found.
constexpr double kStiffer = 5.0;

Matrix3 tangential(const SurfaceOperators& operators, const Points& moved, Eigen::Index f) {
  const auto inverse = matrix_at(operators.inverse_frames, f);
  const auto face = operators.faces.row(f);
  const Eigen::RowVector3d origin = moved.row(face[0]);
  return inverse.col(0) * (moved.row(face[1]) - origin) +
         inverse.col(1) * (moved.row(face[2]) - origin);
}

MatrixField tangential(const SurfaceOperators& operators, const Points& moved) {
  MatrixField result(operators.faces.rows(), 9);
#pragma omp parallel for schedule(static)
  for (Eigen::Index f = 0; f < result.rows(); ++f) {
    matrix_at(result, f) = tangential(operators, moved, f);
  }
  return result;
}

// n x 9: the rotation of each vertex, by its faces' weights: those of their terms in the energy, of
// which it is then the minimum, so that the gradient needs none of its derivatives.
MatrixField vertex_rotations(const SurfaceOperators& operators, const MatrixField& jacobians,
                             const Eigen::VectorXd& weights) {
  const CornerTable& corners = operators.corners;
  MatrixField sums(operators.vertices.rows(), 9);
#pragma omp parallel for schedule(static)
  for (Eigen::Index v = 0; v < sums.rows(); ++v) {
    Eigen::Matrix<double, 1, 9> sum = Eigen::Matrix<double, 1, 9>::Zero();
    double total = 0.0;
    for (int i = corners.first[v]; i < corners.first[v + 1]; ++i) {
      const int f = corners.corner[i] / 3;
      total += weights[f];
      sum += weights[f] * jacobians.row(f);
    }
    if (total > 0.0) {
      sums.row(v) = sum / total;
    } else {  // no face around it has an area in the pose that is edited
      matrix_at(sums, v).setIdentity();
    }
  }
  return closest_rotations(sums);
}

// The mean of the rotations at a face's corners, its normal's part taken out.
Matrix3 face_target(const SurfaceOperators& operators, const MatrixField& rotations,
                    Eigen::Index f) {
  const auto face = operators.faces.row(f);
  Matrix3 mean = (matrix_at(rotations, face[0]) + matrix_at(rotations, face[1]) +
                  matrix_at(rotations, face[2])) /
                 3.0;
  const Eigen::RowVector3d normal = operators.face_normals.row(f);
  mean -= normal.transpose() * (normal * mean);
  return mean;
}

}  // namespace

double ArapEnergy::evaluate(const Points& moved, Points& gradient) const {
  const MatrixField jacobians = tangential(operators_, moved);
  const MatrixField rotations = vertex_rotations(operators_, jacobians, operators_.face_areas);
  MatrixField stress(jacobians.rows(), 9);
  Eigen::VectorXd value(jacobians.rows());
#pragma omp parallel for schedule(static)
  for (Eigen::Index f = 0; f < stress.rows(); ++f) {
    const auto t = matrix_at(jacobians, f);
    const Matrix3 target = face_target(operators_, rotations, f);
    value[f] = t.squaredNorm() + 2.0 - 2.0 * t.cwiseProduct(target).sum();
    matrix_at(stress, f) = 2.0 * (t - target);
  }
  gradient = operators_.divergence_of(stress);
  return operators_.face_areas.dot(value);
}

StiffEnergy::StiffEnergy(const SurfaceOperators& operators, const EnclosedVolume* volume,
                         Eigen::VectorXd kept)
    : operators_(operators),
      volume_(volume),
      kept_(std::move(kept)),
      bending_(Eigen::VectorXd::Constant(operators.faces.rows(), kBending)),
      over_at_rest_(turned_over(operators.vertices)) {}

double StiffEnergy::evaluate(const Points& moved, Points& gradient) const {
  const MatrixField jacobians = tangential(operators_, moved);
  const MatrixField rotations =
      vertex_rotations(operators_, jacobians, operators_.face_areas.cwiseProduct(bending_));
  MatrixField stress(jacobians.rows(), 9);
  Eigen::VectorXd value(jacobians.rows());
#pragma omp parallel for schedule(static)
  for (Eigen::Index f = 0; f < stress.rows(); ++f) {
    const Matrix3 t = matrix_at(jacobians, f);
    const Matrix3 target = face_target(operators_, rotations, f);
    // With the singular values s1, s2: a = s1^2 + s2^2, d = s1 s2, and
    // s1^2 + s2^2 + s1^-2 + s2^-2 = a (1 + d^-2).
    const Matrix3 metric = t.transpose() * t;
    const double a = metric.trace();
    const double d = std::sqrt(std::max(0.5 * (a * a - metric.squaredNorm()), 1e-20));
    const double least = std::max(d, kSmallest);
    const double slope = -2.0 / (least * least * least);
    const double inverse = 1.0 / (least * least) + slope * (d - least);
    const Matrix3 grad_d = (a * t - t * metric) / d;
    const double weight = bending_[f];
    value[f] = a * (1.0 + inverse) - 4.0 + weight * (a + 2.0 - 2.0 * t.cwiseProduct(target).sum());
    matrix_at(stress, f) =
        (2.0 + 2.0 * inverse + 2.0 * weight) * t + (a * slope) * grad_d - (2.0 * weight) * target;
  }
  gradient = operators_.divergence_of(stress);
  const double strain = operators_.face_areas.dot(value);
  return volume_ == nullptr ? strain : strain + add_volume(moved, gradient);
}

// sum over components of k (V / kept - 1)^2, k in units of strain over the whole surface.
double StiffEnergy::add_volume(const Points& moved, Points& gradient) const {
  const Points slope = volume_->gradient(moved);
  const Eigen::VectorXd now = volume_->of(moved, slope);
  Eigen::VectorXd factor = Eigen::VectorXd::Zero(kept_.size());
  double value = 0.0;
  for (Eigen::Index c = 0; c < kept_.size(); ++c) {
    if (kept_[c] > 0.0) {
      const double change = now[c] / kept_[c] - 1.0;
      value += kVolume * change * change;
      factor[c] = 2.0 * kVolume * change / kept_[c];
    }
  }
#pragma omp parallel for schedule(static)
  for (Eigen::Index v = 0; v < gradient.rows(); ++v) {
    gradient.row(v) += factor[operators_.component[v]] * slope.row(v);
  }
  return value;
}

Eigen::VectorXi StiffEnergy::turned_over(const Points& points) const {
  const Points normals = face_normals(points, operators_.faces);
  const Points around = neighbour_normals(normals, operators_.faces, operators_.corners);
  Eigen::VectorXi result(normals.rows());
  for (Eigen::Index f = 0; f < result.size(); ++f) {
    result[f] = normals.row(f).dot(around.row(f)) < 0.0 ? 1 : 0;
  }
  return result;
}

int StiffEnergy::stiffen_folds(const Points& moved) {
  const Eigen::VectorXi over = turned_over(moved);
  const CornerTable& corners = operators_.corners;
  std::vector<bool> near(static_cast<size_t>(over.size()), false);
  int count = 0;
  for (Eigen::Index f = 0; f < over.size(); ++f) {
    if (over[f] == 0 || over_at_rest_[f] != 0) {
      continue;
    }
    ++count;
    for (int c = 0; c < 3; ++c) {
      const int v = operators_.faces(f, c);
      for (int i = corners.first[v]; i < corners.first[v + 1]; ++i) {
        near[static_cast<size_t>(corners.corner[i] / 3)] = true;
      }
    }
  }
  for (Eigen::Index f = 0; f < over.size(); ++f) {
    if (near[static_cast<size_t>(f)]) {
      bending_[f] *= kStiffer;
    }
  }
  return count;
}

}  // namespace supple
