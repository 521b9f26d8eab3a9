// SPDX-License-Identifier: GPL-3.0-or-later
#include "handle_checks.h"

#include <Eigen/LU>
#include <cmath>
#include <string>

#include "supple/core/error.h"

namespace supple {

void check_handles(const std::vector<Handle>& handles, Eigen::Index vertex_count) {
  if (handles.empty()) {
    throw Error(ErrorCode::no_handles,
                "There are no handles. Hold or move at least one group of vertices.");
  }
  std::vector<int> owner(static_cast<size_t>(vertex_count), -1);
  for (size_t h = 0; h < handles.size(); ++h) {
    const Handle& handle = handles[h];
    if (handle.vertices.size() == 0) {
      throw Error(ErrorCode::empty_handle,
                  "Handle '" + handle.name + "' has no vertices. Give it some or remove it.");
    }
    if (!(handle.weight > 0.0 && handle.weight <= 1.0)) {
      throw Error(ErrorCode::bad_option,
                  "Handle '" + handle.name + "' has the weight " + std::to_string(handle.weight) +
                      ". Give it more than 0 and at most 1, which holds it exactly.");
    }
    for (const int vertex : handle.vertices) {
      if (vertex < 0 || vertex >= vertex_count) {
        throw Error(ErrorCode::index_out_of_range,
                    "Handle '" + handle.name + "' names vertex " + std::to_string(vertex) +
                        ", but the mesh has " + std::to_string(vertex_count) +
                        " vertices, counted from 0.");
      }
      int& owned = owner[static_cast<size_t>(vertex)];
      if (owned == static_cast<int>(h)) {
        throw Error(ErrorCode::overlapping_handles, "Handle '" + handle.name + "' names vertex " +
                                                        std::to_string(vertex) + " twice.");
      }
      if (owned >= 0) {
        throw Error(ErrorCode::overlapping_handles,
                    "Vertex " + std::to_string(vertex) + " is in two handles, '" +
                        handles[static_cast<size_t>(owned)].name + "' and '" + handle.name +
                        "'. Take it out of one.");
      }
      owned = static_cast<int>(h);
    }
  }
}

void check_targets(const std::vector<Handle>& handles, const std::vector<HandleTarget>& targets) {
  if (targets.size() != handles.size()) {
    throw Error(ErrorCode::wrong_shape, "There are " + std::to_string(handles.size()) +
                                            " handles but " + std::to_string(targets.size()) +
                                            " targets.");
  }
  for (size_t h = 0; h < handles.size(); ++h) {
    const std::string name = "Handle '" + handles[h].name + "'";
    if (targets[h].matrix && targets[h].positions) {
      throw Error(ErrorCode::bad_option, name + " has a matrix and positions; give it one.");
    }
    if (targets[h].matrix) {
      const Eigen::Matrix4d& matrix = *targets[h].matrix;
      if (!matrix.allFinite()) {
        throw Error(ErrorCode::not_finite,
                    name + " has a matrix with numbers that are not finite.");
      }
      const Eigen::Matrix3d linear = matrix.topLeftCorner<3, 3>();
      const double size = linear.norm();
      if (!(std::abs(linear.determinant()) > 1e-12 * size * size * size)) {
        throw Error(ErrorCode::singular_matrix,
                    name +
                        " has a matrix without an inverse (a scale of 0?). Give every axis a "
                        "scale other than 0.");
      }
      if (!matrix.row(3).isApprox(Eigen::RowVector4d(0, 0, 0, 1), 1e-9)) {
        throw Error(ErrorCode::bad_option,
                    name +
                        " has a matrix whose last row is not 0 0 0 1. Give an affine matrix for "
                        "column vectors, with the translation in the last column.");
      }
    }
    if (targets[h].positions) {
      if (targets[h].positions->rows() != handles[h].vertices.size()) {
        throw Error(ErrorCode::wrong_shape,
                    name + " has " + std::to_string(handles[h].vertices.size()) + " vertices but " +
                        std::to_string(targets[h].positions->rows()) + " target positions.");
      }
      if (!targets[h].positions->allFinite()) {
        throw Error(ErrorCode::not_finite,
                    name + " has a target position that is not a finite number.");
      }
    }
  }
}

}  // namespace supple
