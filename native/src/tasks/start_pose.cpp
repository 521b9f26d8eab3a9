// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/tasks/start_pose.h"

#include <string>
#include <utility>

#include "supple/core/error.h"
#include "supple/geometry/operators.h"

namespace supple {
namespace {

Points checked(const TriangleMesh& mesh, Points vertices) {
  const Eigen::Index n = mesh.vertices().rows();
  if (vertices.rows() != n) {
    throw Error(ErrorCode::wrong_shape, "The pose has " + std::to_string(vertices.rows()) +
                                            " vertices, the rest mesh " + std::to_string(n) +
                                            "; they must be the same vertices.");
  }
  for (Eigen::Index v = 0; v < n; ++v) {
    if (!vertices.row(v).allFinite()) {
      throw Error(ErrorCode::not_finite,
                  "Vertex " + std::to_string(v) + " of the pose is not at a finite position.");
    }
  }
  return vertices;
}

Points on_surface(const TriangleMesh& mesh, const Points& vertices) {
  return mesh.to_surface(vertices(mesh.mesh_vertex(), Eigen::all));
}

}  // namespace

StartPose::StartPose(const PreparedMesh& prepared, Points vertices_in)
    : mesh_vertices(checked(prepared.mesh, std::move(vertices_in))),
      vertices(on_surface(prepared.mesh, mesh_vertices)),
      jacobians(prepared.operators.jacobians_of(vertices)),
      face_normals(supple::face_normals(vertices, prepared.operators.faces)),
      vertex_normals(supple::vertex_normals(vertices, prepared.operators.faces)) {}

}  // namespace supple
