// SPDX-License-Identifier: GPL-3.0-or-later
// Discrete differential operators of a triangle mesh without zero-area faces (`TriangleMesh`'s
// surface). Conventions: docs/conventions.md.
#pragma once

#include "supple/core/types.h"

namespace supple {

/// n x n cotangent Laplacian W, symmetric positive semidefinite: (W u)_i = sum_j w_ij (u_i - u_j),
/// w_ij = (cot a_ij + cot b_ij) / 2. Rows sum to 0. Dimensionless.
/// Source: Pinkall and Polthier 1993; the paper's Delta.
SparseMatrix cotan_laplacian(const Points& vertices, const Faces& faces);

/// n: lumped mass, each vertex's mixed Voronoi area; sums to the surface's area, all > 0 where a
/// vertex has a face. Source: Meyer, Desbrun, Schroeder and Barr 2003, section 3.3; the paper's M.
Eigen::VectorXd lumped_mass(const Points& vertices, const Faces& faces);

/// 3m x n gradient: rows 3f..3f+2 of (G u) are the tangent gradient of the piecewise linear u on
/// face f, per unit of length.
SparseMatrix gradient(const Points& vertices, const Faces& faces);

/// n x 3m integrated divergence G^T A, A the face areas; G^T A G = W.
SparseMatrix divergence(const SparseMatrix& gradient, const Eigen::VectorXd& face_areas);

enum class AveragingWeights {
  uniform,  ///< 1 / number of incident faces, as the paper
  area,     ///< face area / area of the incident faces
};

/// n x m averaging from faces to vertices, each row sums to 1. The paper's I.
SparseRowMatrix average_faces_to_vertices(const Faces& faces, Eigen::Index vertex_count,
                                          AveragingWeights weights,
                                          const Eigen::VectorXd& face_areas);

/// m x c: mean of each face's three corners, from n x c. The paper's I^T.
template <class Scalar>
RowMatrix<Scalar> average_vertices_to_faces(const Faces& faces, const RowMatrix<Scalar>& field) {
  RowMatrix<Scalar> out(faces.rows(), field.cols());
#pragma omp parallel for schedule(static)
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    out.row(f) = (field.row(faces(f, 0)) + field.row(faces(f, 1)) + field.row(faces(f, 2))) *
                 Scalar(1.0 / 3.0);
  }
  return out;
}

/// The transpose of `average_vertices_to_faces`: n x c from m x c, for backward passes.
template <class Scalar>
RowMatrix<Scalar> average_vertices_to_faces_backward(const Faces& faces, Eigen::Index vertex_count,
                                                     const RowMatrix<Scalar>& field) {
  RowMatrix<Scalar> out = RowMatrix<Scalar>::Zero(vertex_count, field.cols());
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    for (int c = 0; c < 3; ++c) {
      out.row(faces(f, c)) += field.row(f) * Scalar(1.0 / 3.0);
    }
  }
  return out;
}

/// n x 3: area-weighted unit vertex normals (zero where they cancel).
Points vertex_normals(const Points& vertices, const Faces& faces);

}  // namespace supple
