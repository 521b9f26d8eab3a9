// SPDX-License-Identifier: GPL-3.0-or-later
// Surfaces and networks for joint training, small enough for finite differences.
#pragma once

#include <memory>

#include "native/learning/diffusion_nets.h"
#include "supple/learning/joint_loss.h"

namespace supple::test {

inline FeatureArchitecture small_features() {
  return {FeatureInput::wave_kernel, {6, 5, 8, 1}, 12};
}

inline Architecture small_jacobians() {
  return {Configuration::equivariant, SignalKind::spectral, 12, 8};
}

/// Networks with every part awake.
template <class Scalar>
JointNetworks<Scalar> small_networks(uint64_t seed) {
  JointNetworks<Scalar> networks{
      {small_features(), awake_diffusion_net<Scalar>(small_features().sizes, seed, 0.1)},
      LocalJacobianNetwork<Scalar>(small_jacobians(), seed)};
  // As it starts, the last layer hardly changes the signal.
  networks.jacobians->parameters().weights.back() *= Scalar(30);
  return networks;
}

/// A mesh with all that joint training needs of it.
template <class Scalar>
struct PreparedSurface {
  explicit PreparedSurface(const zoo::Mesh& mesh)
      : operators(TriangleMesh(mesh.vertices, mesh.faces)),
        basis(eigenbasis(operators.laplacian, operators.mass, {.count = 13})),
        surface(operators, basis, small_features(), 9,
                std::make_shared<const NetworkContext<Scalar>>(operators, basis, 12, 0)) {}

  SurfaceOperators operators;
  Eigenbasis basis;
  JointSurface<Scalar> surface;
};

/// An uneven body: no symmetry, no multiple eigenvalues.
inline zoo::Mesh body(unsigned seed, double stretch = 1.3) {
  zoo::Mesh mesh = zoo::perturbed_sphere(1, seed);
  mesh.vertices.col(0) *= stretch;
  mesh.vertices.col(1) *= 0.8;
  return mesh;
}

}  // namespace supple::test
