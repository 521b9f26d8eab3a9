// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/losses.h"

#include "supple/geometry/jacobians.h"

namespace supple {

namespace {

// embedding: V of the prediction; placed: V2 as V is to be compared with it; solve_backward: the
// gradient with respect to the Poisson right-hand side from the one with respect to V.
template <class SolveBackward>
LossValues loss_of_embedding(const SurfaceOperators& source, const LossWeights& weights,
                             const MatrixField& truth, const Points& placed,
                             const MatrixField& predicted, const Points& embedding,
                             const SolveBackward& solve_backward, MatrixField* grad) {
  const MatrixField jacobian_error = predicted - truth;
  const Points position_error = embedding - placed;
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
            source.divergence_backward(solve_backward(grad_embedding));
  }
  return loss;
}

}  // namespace

LossValues supervised_loss(const SurfaceOperators& source, const FreePoisson& poisson,
                           const LossWeights& weights, const Points& target,
                           const MatrixField& predicted, MatrixField* grad) {
  return loss_of_embedding(
      source, weights, source.jacobians_of(target), poisson.centred(target), predicted,
      poisson.solve(source.divergence_of(predicted)),
      [&](const Points& g) { return poisson.solve_backward(g); }, grad);
}

LossValues supervised_loss(const SurfaceOperators& source, const HeldSystem& poisson,
                           const LossWeights& weights, const Points& target,
                           const MatrixField& predicted, MatrixField* grad) {
  Points held(poisson.held().size(), 3);
  for (Eigen::Index i = 0; i < held.rows(); ++i) {
    held.row(i) = target.row(poisson.held()[i]);
  }
  return loss_of_embedding(
      source, weights, source.jacobians_of(target), target, predicted,
      poisson.solve(source.divergence_of(predicted), held),
      [&](const Points& g) { return poisson.solve_backward(g); }, grad);
}

}  // namespace supple
