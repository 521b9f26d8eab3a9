// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/tangent_gradient.h"

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "supple/core/error.h"

namespace supple {

Points tangent_axes(const Points& normals) {
  Points axes(normals.rows(), 3);
  for (Eigen::Index v = 0; v < normals.rows(); ++v) {
    const Eigen::RowVector3d normal = normals.row(v);
    axes.row(v) =
        normal.isZero(0.0) ? Eigen::RowVector3d::Zero().eval() : normal.unitOrthogonal().eval();
  }
  return axes;
}

SparseRowMatrix tangent_gradient(const SurfaceOperators& operators, const Points& axes) {
  const Eigen::Index n = operators.vertices.rows();
  if (axes.rows() != n) {
    throw Error(ErrorCode::wrong_shape, "There are " + std::to_string(axes.rows()) +
                                            " tangent axes for a surface of " + std::to_string(n) +
                                            " vertices; there must be one for each.");
  }
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(6 * static_cast<size_t>(operators.corners.corner.size()));
  for (Eigen::Index v = 0; v < n; ++v) {
    const Eigen::RowVector3d first = axes.row(v),
                             second = operators.vertex_normals.row(v).cross(axes.row(v));
    const int begin = operators.corners.first[v], end = operators.corners.first[v + 1];
    double area = 0.0;
    for (int i = begin; i < end; ++i) {
      area += operators.face_areas[operators.corners.corner[i] / 3];
    }
    for (int i = begin; i < end; ++i) {
      const int f = operators.corners.corner[i] / 3;
      const auto inverse = matrix_at(operators.inverse_frames, f);
      const double weight = operators.face_areas[f] / area;
      for (int c = 0; c < 3; ++c) {
        // Columns 0 and 1 of E^-1 are the gradients of the functions that are 1 at corners 1 and 2.
        const Eigen::Vector3d gradient =
            c == 0 ? Eigen::Vector3d(-inverse.col(0) - inverse.col(1)) : inverse.col(c - 1).eval();
        const int column = operators.faces(f, c);
        entries.emplace_back(static_cast<int>(v), column, weight * first.dot(gradient));
        entries.emplace_back(static_cast<int>(n + v), column, weight * second.dot(gradient));
      }
    }
  }
  SparseRowMatrix result(2 * n, n);
  result.setFromTriplets(entries.begin(), entries.end());
  return result;
}

}  // namespace supple
