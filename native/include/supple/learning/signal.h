// SPDX-License-Identifier: GPL-3.0-or-later
// The coarse signals a Local Jacobian Network starts from.
#pragma once

#include <string>
#include <vector>

#include "supple/core/types.h"
#include "supple/geometry/surface_operators.h"
#include "supple/spectral/eigenbasis.h"

namespace supple {

enum class SignalKind {
  rotation,  ///< closest rotations of a suggested deformation; editing. The paper, section 4.4.
  spectral,  ///< Jacobians to a spectrally projected target; refining a map. The paper, Eqn 9.
};
const char* to_string(SignalKind kind);
/// Errors: `bad_option` for any other name.
SignalKind signal_kind(const std::string& name);

/// Fields of 3x3 matrices, m x 9 each. Turning the source by R1 and the target by R2 (rows: v -> v
/// R) takes every one of them from X to R1^T X R2.
struct Signal {
  /// `front()` is the coarse Jacobian, the answer without a network; `back()` the one the
  /// equivariant network corrects. For `rotation` they are the same field.
  std::vector<MatrixField> fields;
};
int field_count(SignalKind kind);

/// The closest rotation of each of m x 9 suggested Jacobians.
Signal rotation_signal(const MatrixField& suggested);

/// From a source to a coarse target in the same connectivity (n x 3, its coordinates in `count`
/// eigenfunctions). Fields: the Jacobian E1^-1 E2 of the paper; and the rotation that best takes
/// the frames of the source, projected to the same eigenfunctions, to those of the coarse target:
/// what is left of the deformation when both sides have lost their detail.
Signal spectral_signal(const SurfaceOperators& source, const Eigenbasis& basis,
                       const Points& coarse_target, Eigen::Index count);
/// The same from the source's own projection, n x 3: basis.project(source.vertices, count).
Signal spectral_signal(const SurfaceOperators& source, const Points& coarse_source,
                       const Points& coarse_target);

/// n x 3: gradient with respect to the coarse target, from that with respect to the fields of
/// `spectral_signal(source, coarse_source, coarse_target)`, held by `grad` in the same places. The
/// source side is fixed. Faces without a normal there, flattened below 1e-9 of their area at rest,
/// have no derivative of one; of rotations that are not unique see `closest_rotation_backward`.
/// Errors: `wrong_shape` where `grad` is not two m x 9 fields or the points are not n x 3.
Points spectral_signal_backward(const SurfaceOperators& source, const Points& coarse_source,
                                const Points& coarse_target, const Signal& grad);

/// The coarse target of a pair in 1:1 correspondence, the paper's Eqn 10 with the true map:
/// Phi1 Phi1^+ Phi2 Phi2^+ V2, n x 3.
Points spectral_target(const Eigenbasis& source_basis, const Eigenbasis& target_basis,
                       const Points& target, Eigen::Index count);

}  // namespace supple
