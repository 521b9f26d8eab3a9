// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/surface_operators.h"

#include <algorithm>

#include "corner_forces.h"
#include "neighbours.h"
#include "supple/geometry/jacobians.h"
#include "supple/geometry/operators.h"

namespace supple {

CornerTable::CornerTable(const Faces& faces, Eigen::Index n)
    : first(Eigen::VectorXi::Zero(n + 1)), corner(3 * faces.rows()) {
  for (Eigen::Index i = 0; i < corner.size(); ++i) {
    ++first[faces.data()[i] + 1];
  }
  for (Eigen::Index v = 0; v < n; ++v) {
    first[v + 1] += first[v];
  }
  Eigen::VectorXi next = first;
  for (int i = 0; i < corner.size(); ++i) {
    corner[next[faces.data()[i]]++] = i;
  }
}

Points neighbour_normals(const Points& normals, const Faces& faces, const CornerTable& corners) {
  Points sums = Points::Zero(faces.rows(), 3);
#pragma omp parallel for schedule(static)
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    for_each_neighbour(faces, corners, f, [&](int other) { sums.row(f) += normals.row(other); });
  }
  return sums;
}

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
      average(
          average_faces_to_vertices(faces, vertices.rows(), AveragingWeights::uniform, face_areas)),
      corners(faces, vertices.rows()) {}

MatrixField SurfaceOperators::jacobians_of(const Points& moved) const {
  return jacobians(inverse_frames, moved, faces);
}

Points SurfaceOperators::divergence_of(const MatrixField& jacobians) const {
  CornerForces forces(*this);
  constexpr Eigen::Index kFaces = 512;
#pragma omp parallel for schedule(static)
  for (Eigen::Index first = 0; first < faces.rows(); first += kFaces) {
    forces.set(first, std::min(kFaces, faces.rows() - first), jacobians.row(first).data());
  }
  return forces.gathered();
}

MatrixField SurfaceOperators::divergence_backward(const Points& grad) const {
  MatrixField result(faces.rows(), 9);
  Eigen::Map<Points>(result.data(), 3 * faces.rows(), 3) = divergence.transpose() * grad;
  return result;
}

}  // namespace supple
