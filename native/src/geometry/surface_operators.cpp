// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/surface_operators.h"

#include "supple/geometry/jacobians.h"
#include "supple/geometry/operators.h"

namespace supple {

SurfaceOperators::SurfaceOperators(const TriangleMesh& mesh)
    : SurfaceOperators(mesh.surface_vertices(), mesh.surface_faces(), mesh.component(),
                       mesh.component_count()) {}

SurfaceOperators::SurfaceOperators(Points vertices_in, Faces faces_in, Eigen::VectorXi component_in,
                                   int component_count_in)
    : vertices(std::move(vertices_in)),
      faces(std::move(faces_in)),
      component(std::move(component_in)),
      component_count(component_count_in),
      face_areas(supple::face_areas(vertices, faces)),
      inverse_frames(supple::inverse_frames(face_frames(vertices, faces))),
      face_normals(supple::face_normals(vertices, faces)),
      vertex_normals(supple::vertex_normals(vertices, faces)),
      laplacian(cotan_laplacian(vertices, faces)),
      mass(lumped_mass(vertices, faces)),
      divergence(supple::divergence(gradient(vertices, faces), face_areas)),
      average(average_faces_to_vertices(faces, vertices.rows(), AveragingWeights::uniform,
                                        face_areas)) {}

MatrixField SurfaceOperators::jacobians_of(const Points& moved) const {
  return jacobians(inverse_frames, moved, faces);
}

Points SurfaceOperators::divergence_of(const MatrixField& jacobians) const {
  return divergence * stacked(jacobians);
}

MatrixField SurfaceOperators::divergence_backward(const Points& grad) const {
  MatrixField result(faces.rows(), 9);
  Eigen::Map<Points>(result.data(), 3 * faces.rows(), 3) = divergence.transpose() * grad;
  return result;
}

}  // namespace supple
