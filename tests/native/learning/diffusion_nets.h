// SPDX-License-Identifier: GPL-3.0-or-later
// DiffusionNets and surfaces for tests: small enough for finite differences, with every part awake.
#pragma once

#include "native/support.h"
#include "supple/learning/diffusion_net.h"
#include "supple/learning/feature_inputs.h"

namespace supple::test {

/// A surface with all that the network needs.
template <class Scalar>
struct FeatureSurface {
  FeatureSurface(const zoo::Mesh& mesh, int eigenfunctions)
      : operators(TriangleMesh(mesh.vertices, mesh.faces)),
        basis(eigenbasis(operators.laplacian, operators.mass, {.count = eigenfunctions + 1})),
        context(operators, basis, eigenfunctions) {}
  RowMatrix<Scalar> inputs(FeatureInput kind, int count) const {
    return feature_inputs(kind, operators, basis, count).template cast<Scalar>();
  }

  SurfaceOperators operators;
  Eigenbasis basis;
  DiffusionContext<Scalar> context;
};

/// A network as one looks after training: times above 0 and biases. strength: of A, to be chosen
/// such that the gradient features are neither all 0 nor all at the ends of tanh.
template <class Scalar>
DiffusionParameters<Scalar> awake_diffusion_net(const DiffusionSizes& sizes, uint64_t seed,
                                                double strength = 1.0) {
  auto parameters = DiffusionParameters<Scalar>::random(sizes, seed);
  uint64_t next = seed + 100;
  const auto random = [&](RowMatrix<Scalar>& values) {
    values = (0.3 * noise(1, values.cols(), ++next)).template cast<Scalar>();
  };
  random(parameters.first.bias);
  for (auto& block : parameters.blocks) {
    const RowMatrix<double> times = noise(1, sizes.width, ++next);
    block.times = (0.02 + 0.015 * times.array()).matrix().template cast<Scalar>();
    block.real *= static_cast<Scalar>(strength);
    block.imaginary *= static_cast<Scalar>(strength);
    for (auto& layer : block.layers) {
      random(layer.bias);
    }
  }
  random(parameters.last.bias);
  return parameters;
}

}  // namespace supple::test
