// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "supple/core/types.h"
#include "supple/geometry/surface_operators.h"

namespace supple {

/// The weights of the paper's unsupervised loss of Jacobians: 1, alpha_6, alpha_7.
struct JacobianWeights {
  double fit = 1.0;
  double smoothness = 20.0;
  double determinant = 10.0;

  bool any() const { return fit != 0.0 || smoothness != 0.0 || determinant != 0.0; }
};

/// The three terms before weighting, and their weighted sum.
struct JacobianLossValues {
  double fit = 0.0, smoothness = 0.0, determinant = 0.0, total = 0.0;
};

/// Gradients of the total, m x 9 each.
struct JacobianLossGradient {
  MatrixField predicted;
  MatrixField rough;
};

/// The paper's unsupervised loss (Eqn 14) of a network's m x 9 `predicted` Jacobians J, against
/// those of a soft map, `rough`:
///   sum_f A_f |J' - J|^2 + a6 sum_f A_f |J - H J|^2 + a7 sum_f A_f (det J - 1)^2.
/// Faces count by their area (the source's is 1), as in `supervised_loss`.
/// adjacency: H, `face_adjacency`.
/// Errors: `wrong_shape`, `not_finite`.
JacobianLossValues jacobian_loss(const SurfaceOperators& source, const SparseRowMatrix& adjacency,
                                 const JacobianWeights& weights, const MatrixField& rough,
                                 const MatrixField& predicted,
                                 JacobianLossGradient* gradient = nullptr);

}  // namespace supple
