// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/tasks/metrics.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "supple/core/error.h"
#include "supple/geometry/mesh.h"
#include "supple/geometry/surface_operators.h"

namespace supple {
namespace {

void check_same(const Points& a, const Points& b) {
  if (a.rows() != b.rows()) {
    throw Error(ErrorCode::wrong_shape, "The meshes have " + std::to_string(a.rows()) + " and " +
                                            std::to_string(b.rows()) +
                                            " vertices; they must be the same vertices.");
  }
}

// Edges v1 - v0, v2 - v0 in an orthonormal frame of the face's plane, as columns.
Eigen::Matrix2d flattened(const Points& v, const Faces& f, Eigen::Index i) {
  const Eigen::RowVector3d e1 = v.row(f(i, 1)) - v.row(f(i, 0));
  const Eigen::RowVector3d e2 = v.row(f(i, 2)) - v.row(f(i, 0));
  const double length = e1.norm();
  Eigen::Matrix2d result = Eigen::Matrix2d::Zero();
  if (length > 0.0) {
    const double along = e1.dot(e2) / length;
    result << length, along, 0.0, e1.cross(e2).norm() / length;
  }
  return result;
}

double distortion(const Eigen::Matrix2d& rest, const Eigen::Matrix2d& posed) {
  constexpr double kSmallest = 1e-6;
  const Eigen::Matrix2d j = posed * rest.inverse();
  // Singular values of a 2x2 matrix: sum and difference of its turning and mirroring parts.
  const double turning = std::hypot(j(0, 0) + j(1, 1), j(1, 0) - j(0, 1)) / 2.0;
  const double mirroring = std::hypot(j(0, 0) - j(1, 1), j(1, 0) + j(0, 1)) / 2.0;
  const double s1 = std::max(kSmallest, turning + mirroring);
  const double s2 = std::max(kSmallest, std::abs(turning - mirroring));
  return s1 * s1 + s2 * s2 + 1.0 / (s1 * s1) + 1.0 / (s2 * s2) - 4.0;
}

}  // namespace

Eigen::VectorXd face_distortion(const Points& rest, const Faces& faces, const Points& posed) {
  check_same(rest, posed);
  Eigen::VectorXd result = Eigen::VectorXd::Zero(faces.rows());
#pragma omp parallel for schedule(static)
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    if (!is_degenerate(rest, faces, f)) {
      result[f] = distortion(flattened(rest, faces, f), flattened(posed, faces, f));
    }
  }
  return result;
}

double symmetric_dirichlet(const Points& rest, const Faces& faces, const Points& posed) {
  const Eigen::VectorXd areas = face_areas(rest, faces);
  return face_distortion(rest, faces, posed).dot(areas) / areas.sum();
}

int flipped_faces(const Points& rest, const Faces& faces, const Points& posed) {
  check_same(rest, posed);
  const Points rest_normals = face_normals(rest, faces);
  const Points posed_normals = face_normals(posed, faces);
  const CornerTable corners(faces, rest.rows());
  const Points rest_around = neighbour_normals(rest_normals, faces, corners);
  const Points posed_around = neighbour_normals(posed_normals, faces, corners);
  const Eigen::VectorXd rest_areas = face_areas(rest, faces);
  const Eigen::VectorXd posed_areas = face_areas(posed, faces);
  int count = 0;
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    if (is_degenerate(rest, faces, f)) {
      continue;
    }
    // At exactly 90 degrees (three sheets on an edge) rounding must not decide.
    constexpr double kEdge = 1e-9;
    const bool was_over = rest_normals.row(f).dot(rest_around.row(f)) < kEdge;
    const bool is_over = posed_normals.row(f).dot(posed_around.row(f)) < -kEdge;
    const bool collapsed = posed_areas[f] < 1e-6 * rest_areas[f];
    count += ((is_over && !was_over) || collapsed) ? 1 : 0;
  }
  return count;
}

double pose_error(const Points& rest, const Faces& faces, const Points& posed,
                  const Points& truth) {
  check_same(rest, posed);
  check_same(rest, truth);
  const Eigen::VectorXd areas = face_areas(rest, faces);
  Eigen::VectorXd mass = Eigen::VectorXd::Zero(rest.rows());
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    for (int c = 0; c < 3; ++c) {
      mass[faces(f, c)] += areas[f] / 3.0;
    }
  }
  const double mean_square = mass.dot((posed - truth).rowwise().squaredNorm()) / mass.sum();
  return 100.0 * std::sqrt(mean_square / areas.sum());
}

}  // namespace supple
