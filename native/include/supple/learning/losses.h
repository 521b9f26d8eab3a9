// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "supple/core/types.h"
#include "supple/geometry/held_system.h"
#include "supple/geometry/surface_operators.h"

namespace supple {

/// The weights alpha_1, alpha_2, alpha_3 of the paper's supervised loss.
struct LossWeights {
  double jacobian = 1.0;
  double position = 10.0;
  double integrated = 2.0;
};

/// The three terms before weighting, and their weighted sum.
struct LossValues {
  double jacobian = 0.0, position = 0.0, integrated = 0.0, total = 0.0;
};

/// The paper's supervised loss (Eqn 5) of m x 9 predicted Jacobians, against an n x 3 target in the
/// source's connectivity and units, with V = `poisson` of the prediction:
///   a1 sum_f A_f |J* - J|^2 + a2 sum_i M_i |V2 - V|^2 + a3 sum_f A_f |J* - E1^-1 E(V)|^2.
/// Faces and vertices count by their area (the source's is 1): by number, thin faces would rule.
/// V2 is compared after each component's centroid is taken out, which Poisson does not determine.
/// grad: if given, m x 9, the total's gradient with respect to the prediction.
LossValues supervised_loss(const SurfaceOperators& source, const FreePoisson& poisson,
                           const LossWeights& weights, const Points& target,
                           const MatrixField& predicted, MatrixField* grad);

/// The same loss for an edit: V solves the Poisson equation with the rows `poisson.held()` at their
/// target, which places it, so nothing is centred.
LossValues supervised_loss(const SurfaceOperators& source, const HeldSystem& poisson,
                           const LossWeights& weights, const Points& target,
                           const MatrixField& predicted, MatrixField* grad);

}  // namespace supple
