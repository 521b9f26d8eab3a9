// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/surface_operators.h"

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
  CornerForces<double> forces(*this);
#pragma omp parallel for schedule(static)
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    const double* const x = jacobians.data() + 9 * f;
    // Columns 0 and 1 of E^-1 are the gradients of the functions that are 1 at corners 1 and 2.
    const double* const inverse = inverse_frames.data() + 9 * f;
    auto& force = forces.at(f);
    for (int j = 0; j < 3; ++j) {
      force.one[j] =
          face_areas[f] * (inverse[0] * x[j] + inverse[3] * x[3 + j] + inverse[6] * x[6 + j]);
      force.two[j] =
          face_areas[f] * (inverse[1] * x[j] + inverse[4] * x[3 + j] + inverse[7] * x[6 + j]);
    }
  }
  return forces.gathered();
}

MatrixField SurfaceOperators::divergence_backward(const Points& grad) const {
  MatrixField result(faces.rows(), 9);
  Eigen::Map<Points>(result.data(), 3 * faces.rows(), 3) = divergence.transpose() * grad;
  return result;
}

}  // namespace supple
