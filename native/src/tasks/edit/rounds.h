// SPDX-License-Identifier: GPL-3.0-or-later
// One round of an edit, local part: what a Poisson solve is to add to the moved vertices. Those
// that return n x 3 return grad^T A (T - J), with J the Jacobians of `moved` and T the target of
// each face. start: S, what the face is given before it turns (the Jacobians of another pose
// than rest that the edit starts from, or a stretch), or nullptr; Q: the rotation with the least |J
// - S Q|, to single precision.
#pragma once

#include "face_blocks.h"

namespace supple {

/// T = S W R, with R the rotation about the mean of `vectors` (n x 3, rotation vectors) at the
/// face's corners and W `whole`.
Points towards_turned(const FaceBlocks& faces, const Points& moved,
                      const RowMatrix<double>& vectors, const Matrix3& whole,
                      const BlockField* start);

/// T = S Q.
Points towards_rotations(const FaceBlocks& faces, const Points& moved, const BlockField* start);

/// m x 9: Q.
MatrixField rotations_of(const FaceBlocks& faces, const Points& moved, const BlockField* start);

/// T = S P Q, of predicted Jacobians P Q (m x 9) from the start with P brought nearer to the
/// identity: of P - I, `share` is kept and no more than `most` in norm. stretch: set to S P.
Points towards_bounded(const FaceBlocks& faces, const Points& moved, const MatrixField& predicted,
                       double share, double most, const BlockField* start, BlockField& stretch);

}  // namespace supple
