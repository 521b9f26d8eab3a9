// SPDX-License-Identifier: GPL-3.0-or-later
// Networks and rest meshes for tests: small enough for finite differences, with every part awake.
#pragma once

#include <cmath>

#include "native/support.h"
#include "supple/learning/network.h"

namespace supple::test {

/// A rest mesh with all that a network needs. Not movable: the context points into it.
template <class Scalar>
struct RestMesh {
  RestMesh(const zoo::Mesh& source, int eigenfunctions, Eigen::Index samples)
      : mesh(source.vertices, source.faces),
        operators(mesh),
        basis(eigenbasis(operators.laplacian, operators.mass, {.count = eigenfunctions + 1})),
        context(operators, basis, eigenfunctions, samples) {}
  RestMesh(const RestMesh&) = delete;
  RestMesh& operator=(const RestMesh&) = delete;

  TriangleMesh mesh;
  SurfaceOperators operators;
  Eigenbasis basis;
  NetworkContext<Scalar> context;
};

/// The signal of either kind for a target in surface units.
template <class Scalar>
Signal signal_of(SignalKind kind, const RestMesh<Scalar>& rest, const Points& target,
                 Eigen::Index count = 8) {
  if (kind == SignalKind::rotation) {
    return rotation_signal(rest.operators.jacobians_of(target));
  }
  const Eigen::Index cut = rest.basis.stable_count(count);
  return spectral_signal(rest.operators, rest.basis, rest.basis.project(target, cut), cut);
}

/// A network as one looks after training: inputs normalised on `signal`, and a last layer that
/// moves the answer by about `strength` (a new `equivariant` one hardly does).
template <class Scalar>
LocalJacobianNetwork<Scalar> awake_network(const Architecture& architecture, uint64_t seed,
                                           const NetworkContext<Scalar>& context,
                                           const Signal& signal, double strength = 1.0) {
  using Row = typename LocalJacobianNetwork<Scalar>::Row;
  LocalJacobianNetwork<Scalar> network(architecture, seed);
  auto& parameters = network.parameters();
  if (architecture.configuration == Configuration::equivariant) {
    parameters.weights.back() *= static_cast<Scalar>(100.0 * strength);
  }
  for (size_t l = 0; l < parameters.biases.size(); ++l) {
    const auto random = noise(1, parameters.biases[l].size(), seed + 100 + l);
    parameters.biases[l] = (0.1 * random).template cast<Scalar>();
  }
  const RowMatrix<double> raw = network.raw_inputs(context, signal).template cast<double>();
  const Eigen::RowVectorXd mean = raw.colwise().mean();
  const Eigen::RowVectorXd deviation =
      (raw.rowwise() - mean).colwise().norm() / std::sqrt(static_cast<double>(raw.rows()));
  // One mesh hardly varies where a training set does; its smallest deviations must not be blown up.
  constexpr double kFloor = 0.1;
  network.set_normalisation(
      Row(mean.template cast<Scalar>()),
      Row((deviation.array() + kFloor).inverse().matrix().template cast<Scalar>()));
  return network;
}

}  // namespace supple::test
