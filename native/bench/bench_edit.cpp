// SPDX-License-Identifier: GPL-3.0-or-later
// What an edit costs, by number of vertices: preparing, binding handles, one warm solve.
#include <benchmark/benchmark.h>

#include <memory>

#include "bumpy_torus.h"
#include "supple/tasks/edit.h"

namespace supple {
namespace {

using bench::bumpy_torus;
using bench::Shape;

struct Bound {
  std::unique_ptr<Editor> editor;
  std::vector<HandleTarget> targets;
};

std::vector<Handle> two_handles(const Shape& shape) {
  std::vector<int> left, right;
  for (int i = 0; i < shape.vertices.rows(); ++i) {
    if (shape.vertices(i, 0) < -1.1) {
      left.push_back(i);
    } else if (shape.vertices(i, 0) > 1.1) {
      right.push_back(i);
    }
  }
  const auto vector = [](std::vector<int>& v) {
    return Eigen::VectorXi(Eigen::Map<Eigen::VectorXi>(v.data(), static_cast<int>(v.size())));
  };
  return {{"left", vector(left)}, {"right", vector(right)}};
}

Bound bind(const std::shared_ptr<const PreparedMesh>& prepared, const Shape& shape) {
  const Architecture architecture;
  Bound bound;
  bound.editor = std::make_unique<Editor>(
      prepared, two_handles(shape), std::make_shared<LocalJacobianNetwork<float>>(architecture, 1));
  Eigen::Matrix4d lifted = Eigen::Matrix4d::Identity();
  lifted(2, 3) = 0.5;
  bound.targets = {HandleTarget{}, HandleTarget{lifted, std::nullopt}};
  return bound;
}

void prepare(benchmark::State& state) {
  const Shape shape = bumpy_torus(static_cast<int>(state.range(0)));
  for (auto _ : state) {
    const PreparedMesh prepared(shape.vertices, shape.faces);
    benchmark::DoNotOptimize(prepared.basis.residual);
  }
}

void bind_handles(benchmark::State& state) {
  const Shape shape = bumpy_torus(static_cast<int>(state.range(0)));
  const auto prepared = std::make_shared<const PreparedMesh>(shape.vertices, shape.faces);
  for (auto _ : state) {
    const Bound bound = bind(prepared, shape);
    benchmark::DoNotOptimize(bound.editor.get());
  }
}

// `natural` with its default rounds of the network: the weights' values do not change the time.
void warm_edit(benchmark::State& state) {
  const Shape shape = bumpy_torus(static_cast<int>(state.range(0)));
  const auto prepared = std::make_shared<const PreparedMesh>(shape.vertices, shape.faces);
  const Bound bound = bind(prepared, shape);
  for (auto _ : state) {
    const EditResult result = bound.editor->solve(bound.targets);
    benchmark::DoNotOptimize(result.vertices.data());
  }
}

void network_forward(benchmark::State& state, Eigen::Index samples) {
  const Shape shape = bumpy_torus(static_cast<int>(state.range(0)));
  const PreparedMesh prepared(shape.vertices, shape.faces);
  const NetworkContext<float> context(prepared.operators, prepared.basis, 128, samples);
  const LocalJacobianNetwork<float> network(Architecture{}, 1);
  // Bent, as what a network is given: at rest its numbers would be denormal, which take longer.
  Points bent = prepared.operators.vertices;
  for (Eigen::Index i = 0; i < bent.rows(); ++i) {
    bent(i, 2) += 0.3 * std::sin(3.0 * bent(i, 0));
  }
  const Signal signal = rotation_signal(prepared.operators.jacobians_of(bent));
  for (auto _ : state) {
    const MatrixField jacobians = network.forward(context, signal);
    benchmark::DoNotOptimize(jacobians.data());
  }
}

BENCHMARK(prepare)->Arg(1000)->Arg(5000)->Arg(10000)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(bind_handles)
    ->Arg(1000)
    ->Arg(5000)
    ->Arg(10000)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK(warm_edit)
    ->Arg(1000)
    ->Arg(5000)
    ->Arg(10000)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK_CAPTURE(network_forward, sampled, 1024)
    ->Arg(5000)
    ->Arg(10000)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK_CAPTURE(network_forward, every_vertex, 0)
    ->Arg(5000)
    ->Arg(10000)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

}  // namespace
}  // namespace supple
