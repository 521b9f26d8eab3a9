// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "supple/core/types.h"
#include "supple/geometry/mesh.h"

namespace supple {

/// The corners of faces at each vertex: those of vertex v are corner[first[v]] to
/// corner[first[v + 1] - 1], ascending, corner c of face f being 3 f + c. What is summed over them
/// needs no scattering, so threads share it and the sum is always the same.
struct CornerTable {
  CornerTable() = default;
  CornerTable(const Faces& faces, Eigen::Index n);
  Eigen::VectorXi first;   ///< n + 1
  Eigen::VectorXi corner;  ///< 3 m
};

/// m x 3: for each face, the sum of the normals (m x 3) of the faces that share an edge with it.
Points neighbour_normals(const Points& normals, const Faces& faces, const CornerTable& corners);

/// Every operator of a rest surface that the tasks use, built once. n vertices, m faces, area 1.
struct SurfaceOperators {
  explicit SurfaceOperators(const TriangleMesh& mesh);
  /// vertices: n x 3 in surface units; faces: m x 3, none degenerate; component: n labels.
  SurfaceOperators(Points vertices, Faces faces, Eigen::VectorXi component, int component_count);

  Points vertices;
  Faces faces;
  Eigen::VectorXi component;
  int component_count = 0;
  Eigen::VectorXd face_areas;  ///< m
  MatrixField inverse_frames;  ///< m x 9, E1^-1
  Points face_normals;         ///< m x 3
  Points vertex_normals;       ///< n x 3
  SparseMatrix laplacian;      ///< n x n, W
  Eigen::VectorXd mass;        ///< n, diagonal of M
  SparseMatrix divergence;     ///< n x 3m, grad^T A
  SparseRowMatrix average;     ///< n x m, uniform face -> vertex averaging
  CornerTable corners;

  /// m x 9 Jacobians of moved n x 3 vertices.
  MatrixField jacobians_of(const Points& moved) const;
  /// n x 3 right-hand side grad^T A J of the Poisson equation.
  Points divergence_of(const MatrixField& jacobians) const;
  /// m x 9 gradient with respect to J from the one with respect to `divergence_of(J)`.
  MatrixField divergence_backward(const Points& grad) const;
};

/// The paper's average of an m x 9 field at one vertex, as row i of `average` times the field.
inline Eigen::Matrix<double, 1, 9> vertex_average(const SurfaceOperators& operators,
                                                  const MatrixField& field, Eigen::Index i) {
  Eigen::Matrix<double, 1, 9> sum = Eigen::Matrix<double, 1, 9>::Zero();
  for (SparseRowMatrix::InnerIterator it(operators.average, i); it; ++it) {
    sum += it.value() * field.row(it.col());
  }
  return sum;
}

}  // namespace supple
