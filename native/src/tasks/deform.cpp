// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/tasks/deform.h"

#include "supple/core/error.h"
#include "supple/geometry/held_system.h"

namespace supple {

Points deform(const PreparedMesh& prepared, const Points& target, int count,
              const LocalJacobianNetwork<float>* network, ProgressRange progress) {
  const TriangleMesh& mesh = prepared.mesh;
  const SurfaceOperators& source = prepared.operators;
  if (target.rows() != mesh.vertices().rows()) {
    throw Error(ErrorCode::wrong_shape,
                "The target has " + std::to_string(target.rows()) + " vertices, the source " +
                    std::to_string(mesh.vertices().rows()) + "; they must be the same vertices.");
  }
  if (count < 1) {
    throw Error(ErrorCode::bad_option,
                "The target needs at least 1 eigenfunction, not " + std::to_string(count) + ".");
  }
  if (network != nullptr && network->architecture().signal != SignalKind::spectral) {
    throw Error(ErrorCode::bad_option,
                "This network takes rotations. Deforming a pair needs one trained on the spectral "
                "signal.");
  }
  const TriangleMesh target_mesh(target, mesh.faces());
  if (!target_mesh.same_surface_vertices(mesh)) {
    throw Error(
        ErrorCode::wrong_shape,
        "The target has other faces without area than the source, so they cannot be compared "
        "in eigenfunctions.");
  }
  const SurfaceOperators target_operators(target_mesh);
  const Eigenbasis target_basis =
      eigenbasis(target_operators.laplacian, target_operators.mass, {.count = count + 1},
                 progress.stage("eigenbasis of the target", 0.0, 0.8));

  // Both sides have area 1 inside, so that a network never sees a difference of size.
  const Points& truth = target_mesh.surface_vertices();
  const Eigen::Index cut = stable_count(prepared.basis, target_basis, count);
  const Points coarse = spectral_target(prepared.basis, target_basis, truth, cut);
  const Signal signal = spectral_signal(source, prepared.basis, coarse, cut);
  const MatrixField predicted =
      network == nullptr ? signal.fields.front()
                         : network->forward(*prepared.context_for(network->architecture()), signal);
  const FreePoisson poisson(source.laplacian, source.mass, source.component, source.component_count,
                            prepared.symbolic);
  const Points centred = poisson.solve(source.divergence_of(predicted));
  const Points placed = centred + (truth - poisson.centred(truth));
  const Points moved = mesh.to_surface(target_mesh.from_surface(placed));
  progress.report(1.0);
  return mesh.scatter(moved, source.average * source.jacobians_of(moved));
}

}  // namespace supple
