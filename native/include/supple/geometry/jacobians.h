// SPDX-License-Identifier: GPL-3.0-or-later
// Jacobians of a deformation, one a face, and their closest rotations.
#pragma once

#include "supple/core/types.h"

namespace supple {

/// m x 9: frame of each face, rows (first edge v1 - v0, second edge v2 - v0, unit normal).
/// A face without area has a zero normal row. Source: the paper's E, section 3.
MatrixField face_frames(const Points& vertices, const Faces& faces);

/// n x 3: gradient with respect to the vertices, from the m x 9 gradient with respect to
/// `face_frames(...)`; includes the turning of the unit normal. Where that is 0, so is its
/// derivative.
Points face_frames_backward(const Points& vertices, const Faces& faces, const MatrixField& grad);

/// m x 9: inverse of each frame. Needs faces with an area.
MatrixField inverse_frames(const MatrixField& frames);

/// m x 9 Jacobians J = E1^-1 E2 from a rest mesh's inverse frames to moved n x 3 vertices: rest
/// edges times J are moved edges, and the rest normal times J is the moved normal. Source: the
/// paper, Eqn 2.
MatrixField jacobians(const MatrixField& inverse_rest_frames, const Points& moved,
                      const Faces& faces);

/// The same from the moved faces' frames, m x 9.
MatrixField jacobians(const MatrixField& inverse_rest_frames, const MatrixField& moved_frames);

/// n x 3: gradient with respect to the moved vertices, from the m x 9 gradient with respect to
/// `jacobians(...)`; includes the turning of the unit normal.
Points jacobians_backward(const MatrixField& inverse_rest_frames, const Points& moved,
                          const Faces& faces, const MatrixField& grad);

/// The closest rotation Q to a 3x3 matrix J in the Frobenius norm, det Q = +1 (J = W Q with W
/// symmetric: rows are transformed). J may be singular or mirrored: then the closest rotation is
/// still returned, one of several where it is not unique. Source: Higham 1986 (scaled Newton), SVD
/// where that does not apply.
Matrix3 closest_rotation(const Matrix3& j);

/// m x 9: `closest_rotation` of each row.
MatrixField closest_rotations(const MatrixField& jacobians);

/// Polar decomposition J = W Q: Q the closest rotation, W = J Q^T symmetric.
struct PolarDecomposition {
  Matrix3 rotation;
  Matrix3 stretch;
};
PolarDecomposition polar_decomposition(const Matrix3& j);

}  // namespace supple
