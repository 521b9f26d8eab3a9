// SPDX-License-Identifier: GPL-3.0-or-later
// One round of an edit, local part: what a Poisson solve is to add to the moved vertices. Each
// returns grad^T A (T - J), n x 3, with J the Jacobians of `moved` and T the target of each face.
#pragma once

#include "supple/geometry/surface_operators.h"

namespace supple {

/// T the given rotations or Jacobians, m x 9.
Points towards(const SurfaceOperators& operators, const Points& moved, const MatrixField& targets);

/// T = Q, the closest rotation of J.
Points towards_rotations(const SurfaceOperators& operators, const Points& moved);

/// m x 9: Q, the closest rotations of the Jacobians of `moved`.
MatrixField rotations_of(const SurfaceOperators& operators, const Points& moved);

/// m x 9: the rotations Q that have the least |J - S Q|, from another pose than rest. start: m x 9,
/// S, the Jacobians of that pose.
MatrixField rotations_from(const SurfaceOperators& operators, const Points& moved,
                           const MatrixField& start);

/// Sets each matrix X of `field` to S X. start: m x 9, S.
void follow(const MatrixField& start, MatrixField& field);

/// T = S Q, with the rotation Q that has the least |J - S Q|. stretch: m x 9, S.
Points towards_stretched(const SurfaceOperators& operators, const Points& moved,
                         const MatrixField& stretch);

/// predicted: m x 9 Jacobians P Q; returned with P brought nearer to the identity: of P - I,
/// `share` is kept and no more than `most` in norm. stretch: m x 9, set to what is left of P.
void bound_stretch(double share, double most, MatrixField& predicted, MatrixField& stretch);

}  // namespace supple
