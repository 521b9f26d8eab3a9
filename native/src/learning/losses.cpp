// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/losses.h"

#include "supple/geometry/jacobians.h"

namespace supple {

LossValues supervised_loss(const SurfaceOperators& source, const FreePoisson& poisson,
                           const LossWeights& weights, const Points& target,
                           const MatrixField& predicted, MatrixField* grad) {
  const MatrixField truth = source.jacobians_of(target);
  const Points embedding = poisson.solve(source.divergence_of(predicted));
  const MatrixField jacobian_error = predicted - truth;
  const Points position_error = embedding - poisson.centred(target);
  const MatrixField integrated_error = source.jacobians_of(embedding) - truth;

  LossValues loss;
  loss.jacobian = source.face_areas.dot(jacobian_error.rowwise().squaredNorm());
  loss.position = source.mass.dot(position_error.rowwise().squaredNorm());
  loss.integrated = source.face_areas.dot(integrated_error.rowwise().squaredNorm());
  loss.total = weights.jacobian * loss.jacobian + weights.position * loss.position +
               weights.integrated * loss.integrated;

  if (grad != nullptr) {
    const MatrixField grad_integrated =
        2.0 * weights.integrated * (source.face_areas.asDiagonal() * integrated_error);
    const Points grad_embedding =
        2.0 * weights.position * (source.mass.asDiagonal() * position_error) +
        jacobians_backward(source.inverse_frames, embedding, source.faces, grad_integrated);
    *grad = 2.0 * weights.jacobian * (source.face_areas.asDiagonal() * jacobian_error) +
            source.divergence_backward(poisson.solve_backward(grad_embedding));
  }
  return loss;
}

}  // namespace supple
