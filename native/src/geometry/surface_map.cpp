// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/surface_map.h"

#include <cmath>
#include <string>

#include "supple/core/error.h"

namespace supple {
namespace {

bool has_three_corners(const Faces& faces, Eigen::Index f) {
  return faces(f, 0) != faces(f, 1) && faces(f, 1) != faces(f, 2) && faces(f, 2) != faces(f, 0);
}

[[noreturn]] void fail(ErrorCode code, Eigen::Index i, const std::string& what) {
  throw Error(code, "Source point " + std::to_string(i) + " of the map " + what);
}

}  // namespace

void check_surface_map(const SurfaceMap& map, Eigen::Index size, const Faces& target_faces) {
  if (map.face.size() != size || map.weights.rows() != size) {
    throw Error(ErrorCode::wrong_shape, "The map has " + std::to_string(map.face.size()) +
                                            " faces and " + std::to_string(map.weights.rows()) +
                                            " rows of weights for " + std::to_string(size) +
                                            " source points; it was made for another mesh.");
  }
  for (Eigen::Index i = 0; i < size; ++i) {
    const int f = map.face[i];
    if (f < -1 || f >= target_faces.rows()) {
      fail(ErrorCode::index_out_of_range, i,
           "goes to face " + std::to_string(f) + ", but the target has " +
               std::to_string(target_faces.rows()) + " faces, counted from 0.");
    }
    if (f < 0) {
      continue;
    }
    if (!map.weights.row(i).allFinite()) {
      fail(ErrorCode::not_finite, i, "has a weight that is not a finite number.");
    }
    if (map.weights.row(i).minCoeff() < -1e-9 || std::abs(map.weights.row(i).sum() - 1.0) > 1e-6) {
      fail(ErrorCode::bad_option, i,
           "has weights that are no barycentric ones: none may be below 0, and they must sum to "
           "1.");
    }
  }
}

SurfaceMap surface_map(const Eigen::VectorXi& point_map, const Faces& target_faces,
                       Eigen::Index target_vertices) {
  Eigen::VectorXi corner = Eigen::VectorXi::Constant(target_vertices, -1);  // 3 face + corner
  for (const bool three : {true, false}) {
    for (Eigen::Index f = 0; f < target_faces.rows(); ++f) {
      for (int c = 0; c < 3; ++c) {
        const int vertex = target_faces(f, c);
        if (vertex < 0 || vertex >= target_vertices) {
          throw Error(ErrorCode::index_out_of_range,
                      "Face " + std::to_string(f) + " names vertex " + std::to_string(vertex) +
                          ", but the target has " + std::to_string(target_vertices) +
                          " vertices, counted from 0.");
        }
        if (corner[vertex] < 0 && has_three_corners(target_faces, f) == three) {
          corner[vertex] = static_cast<int>(3 * f + c);
        }
      }
    }
  }
  SurfaceMap map{Eigen::VectorXi::Constant(point_map.size(), -1),
                 Points::Zero(point_map.size(), 3)};
  for (Eigen::Index i = 0; i < point_map.size(); ++i) {
    const int vertex = point_map[i];
    if (vertex < -1 || vertex >= target_vertices) {
      fail(ErrorCode::index_out_of_range, i,
           "goes to vertex " + std::to_string(vertex) + ", but the target has " +
               std::to_string(target_vertices) + " vertices, counted from 0.");
    }
    if (vertex >= 0 && corner[vertex] >= 0) {
      map.face[i] = corner[vertex] / 3;
      map.weights(i, corner[vertex] % 3) = 1.0;
    }
  }
  return map;
}

Eigen::VectorXi nearest_corners(const SurfaceMap& map, const Faces& target_faces) {
  check_surface_map(map, map.size(), target_faces);
  Eigen::VectorXi result = Eigen::VectorXi::Constant(map.size(), -1);
  for (Eigen::Index i = 0; i < map.size(); ++i) {
    const int f = map.face[i];
    if (f < 0) {
      continue;
    }
    int best = 0;
    for (int c = 1; c < 3; ++c) {
      const double weight = map.weights(i, c), largest = map.weights(i, best);
      if (weight > largest || (weight == largest && target_faces(f, c) < target_faces(f, best))) {
        best = c;
      }
    }
    result[i] = target_faces(f, best);
  }
  return result;
}

void check_pull_back(const SurfaceMap& map, const Faces& target_faces, Eigen::Index field_rows) {
  check_surface_map(map, map.size(), target_faces);
  for (Eigen::Index i = 0; i < map.size(); ++i) {
    if (map.face[i] < 0) {
      continue;
    }
    const auto corners = target_faces.row(map.face[i]);
    if (corners.minCoeff() < 0 || corners.maxCoeff() >= field_rows) {
      throw Error(
          ErrorCode::index_out_of_range,
          "Face " + std::to_string(map.face[i]) + " of the target names vertex " +
              std::to_string(corners.minCoeff() < 0 ? corners.minCoeff() : corners.maxCoeff()) +
              ", but the field has " + std::to_string(field_rows) +
              " rows; it needs one for each target vertex.");
    }
  }
}

}  // namespace supple
