// SPDX-License-Identifier: GPL-3.0-or-later
#include <limits>
#include <string>

#include "supple/core/error.h"
#include "supple/geometry/surface_map.h"
#include "tasks/initial_map/candidates.h"
#include "tasks/refine/pair.h"

namespace supple {
namespace {

// Beside a layout by less than this part of its extent counts as in it.
constexpr double kBeside = 1e-4;
constexpr double kLeastOverlap = 0.01;

// 3m x 3: in the plane.
Points in_plane(const char* whose, const TriangleMesh& mesh, const RowMatrix<double>& uvs) {
  if (uvs.rows() != mesh.faces().size() || uvs.cols() != 2) {
    throw Error(ErrorCode::wrong_shape, "The " + std::string(whose) + "'s UVs are " +
                                            std::to_string(uvs.rows()) + " x " +
                                            std::to_string(uvs.cols()) + "; there must be " +
                                            std::to_string(mesh.faces().size()) +
                                            " x 2, a row for each corner of each " + "triangle.");
  }
  if (!uvs.allFinite()) {
    throw Error(ErrorCode::not_finite,
                "The " + std::string(whose) + "'s UVs hold NaN or infinity.");
  }
  Points points = Points::Zero(uvs.rows(), 3);
  points.leftCols(2) = uvs;
  return points;
}

}  // namespace

InitialMap uv_map(const PreparedMesh& source, const PreparedMesh& target,
                  const RowMatrix<double>& source_uvs, const RowMatrix<double>& target_uvs) {
  const Points from = in_plane("source", source.mesh, source_uvs);
  const Points to = in_plane("target", target.mesh, target_uvs);
  Faces corners(target.mesh.faces().rows(), 3);
  for (int i = 0; i < corners.size(); ++i) {
    corners.data()[i] = i;
  }
  const auto nearest = ClosestSurfacePoints(to, corners).query(from);
  const Eigen::VectorXi corner = nearest_corners(nearest.map, corners);
  const Eigen::Index n = source.operators.vertices.rows();
  Eigen::VectorXi map = Eigen::VectorXi::Zero(n);
  Eigen::VectorXd away = Eigen::VectorXd::Constant(n, std::numeric_limits<double>::infinity());
  const int* const source_vertex = source.mesh.faces().data();
  for (Eigen::Index c = 0; c < from.rows(); ++c) {
    const int vertex = source.mesh.surface_vertex()[source_vertex[c]];
    if (vertex >= 0 && nearest.squared_distance[c] < away[vertex]) {
      away[vertex] = nearest.squared_distance[c];
      map[vertex] = target.mesh.faces().data()[corner[c]];
    }
  }
  const double extent = (to.colwise().maxCoeff() - to.colwise().minCoeff()).norm();
  const double limit = kBeside * extent;
  const Eigen::Index outside = (away.array() > limit * limit).count();
  if (static_cast<double>(n - outside) < kLeastOverlap * static_cast<double>(n)) {
    throw Error(ErrorCode::bad_option,
                "The UV layouts don't overlap: " + std::to_string(n - outside) + " of " +
                    std::to_string(n) +
                    " source vertices lie in the target's. Choose UV maps that share a layout, or "
                    "start from landmarks.");
  }
  const Eigen::VectorXi anchor = refining::surface_anchor(target.mesh);
  InitialMap result = initial_maps::MeshPair(source, target).finished(Eigen::VectorXi(anchor(map)));
  if (outside > 0) {
    result.notes.push_back({"partial_overlap", static_cast<int>(outside),
                            std::to_string(outside) + " of " + std::to_string(n) +
                                " source vertices lie outside the target's UV layout and take its "
                                "nearest place."});
  }
  return result;
}

}  // namespace supple
