// SPDX-License-Identifier: GPL-3.0-or-later
// What the parts below an edit cost, by number of vertices and threads: products of tall matrices,
// the analysis and the factorisation, solves, eigenbases. `flops` is printed in floating-point
// operations a second (10G/s: 10 GFLOP/s), `bytes_per_second` counts what has to be read and
// written at least once. Names that begin with `large` take minutes and gigabytes; leave them out
// with --benchmark_filter=-^large.
#include <benchmark/benchmark.h>
#include <omp.h>

#include <map>
#include <memory>
#include <vector>

#include "bumpy_torus.h"
#include "supple/core/tall.h"
#include "supple/geometry/operators.h"
#include "supple/geometry/sparse_cholesky.h"
#include "supple/spectral/eigenbasis.h"

namespace supple {
namespace {

// The threads a benchmark asks for, in its second argument.
class Threads {
 public:
  explicit Threads(const benchmark::State& state) : before_(omp_get_max_threads()) {
    omp_set_num_threads(static_cast<int>(state.range(1)));
  }
  ~Threads() { omp_set_num_threads(before_); }
  Threads(const Threads&) = delete;
  Threads& operator=(const Threads&) = delete;

 private:
  int before_;
};

// Of one shape, made once for all benchmarks of its size in a row.
struct Operators {
  SparseMatrix laplacian, shifted;  // W, W + M / area
  Eigen::VectorXd mass;
};
const Operators& operators_of(int count) {
  static std::map<int, Operators> known;
  if (known.count(count) == 0) {
    known.clear();
    const bench::Shape shape = bench::bumpy_torus(count);
    Operators o;
    o.laplacian = cotan_laplacian(shape.vertices, shape.faces);
    o.mass = lumped_mass(shape.vertices, shape.faces);
    o.shifted = o.laplacian;
    o.shifted.diagonal() += o.mass / o.mass.sum();
    known[count] = std::move(o);
  }
  return known[count];
}

// Per iteration, as rates.
void report(benchmark::State& state, double flops, double bytes, double items) {
  const auto runs = static_cast<double>(state.iterations());
  state.counters["flops"] = benchmark::Counter(flops * runs, benchmark::Counter::kIsRate);
  state.SetBytesProcessed(static_cast<int64_t>(bytes * runs));
  state.SetItemsProcessed(static_cast<int64_t>(items * runs));
}

template <class Scalar>
struct TallShape {
  TallShape(Eigen::Index n, Eigen::Index pieces, Eigen::Index width, Eigen::Index columns)
      : stored(static_cast<size_t>(pieces), RowMatrix<Scalar>::Constant(n, width, Scalar(0.5))),
        a(stored.begin(), stored.end()),
        b(RowMatrix<Scalar>::Constant(n, columns, Scalar(0.25))) {}
  std::vector<RowMatrix<Scalar>> stored;
  TallPieces<Scalar> a;
  RowMatrix<Scalar> b;
};

// What one step of the block method does, in the middle of its way: 208 columns times 8.
template <class Scalar>
void transpose_product(benchmark::State& state) {
  const Threads threads(state);
  const Eigen::Index n = state.range(0), k = 208, c = 8;
  TallShape<Scalar> shape(n, k / c, c, c);
  for (auto _ : state) {
    const RowMatrix<Scalar> product = tall_product<Scalar>(shape.a, shape.b);
    benchmark::DoNotOptimize(product.data());
  }
  const auto size = static_cast<double>(n);
  report(state, 2.0 * size * k * c, size * (k + c) * sizeof(Scalar), size);
}

template <class Scalar>
void add_product(benchmark::State& state) {
  const Threads threads(state);
  const Eigen::Index n = state.range(0), k = 208, c = 8;
  TallShape<Scalar> shape(n, k / c, c, c);
  const RowMatrix<Scalar> factors = RowMatrix<Scalar>::Constant(k, c, Scalar(1e-3));
  for (auto _ : state) {
    add_tall_product<Scalar>(Scalar(-1e-3), shape.a, factors, shape.b);
    benchmark::DoNotOptimize(shape.b.data());
  }
  const auto size = static_cast<double>(n);
  report(state, 2.0 * size * k * c, size * (k + 2.0 * c) * sizeof(Scalar), size);
}

// A basis of 128 functions, one piece, in a field of three columns.
void project(benchmark::State& state) {
  const Threads threads(state);
  const Eigen::Index n = state.range(0);
  TallShape<double> shape(n, 1, 128, 3);
  for (auto _ : state) {
    const RowMatrix<double> product = tall_product<double>(shape.a, shape.b);
    benchmark::DoNotOptimize(product.data());
  }
  const auto size = static_cast<double>(n);
  report(state, 2.0 * size * 128 * 3, size * 131 * sizeof(double), size);
}

void analyse(benchmark::State& state) {
  const Threads threads(state);
  const Operators& operators = operators_of(static_cast<int>(state.range(0)));
  for (auto _ : state) {
    const SymbolicCholesky symbolic(operators.shifted);
    benchmark::DoNotOptimize(symbolic.size());
  }
  state.SetItemsProcessed(state.iterations() * operators.mass.size());
}

// Floating-point operations of a factor are not known here: a rate of its entries instead.
void factor(benchmark::State& state) {
  const Threads threads(state);
  const Operators& operators = operators_of(static_cast<int>(state.range(0)));
  const auto symbolic = std::make_shared<const SymbolicCholesky>(operators.shifted);
  double entries = 0.0;
  for (auto _ : state) {
    const SparseCholesky cholesky(operators.shifted, symbolic);
    entries = static_cast<double>(cholesky.factor_entries());
  }
  state.counters["entries"] = entries;
  state.SetBytesProcessed(static_cast<int64_t>(entries * 8.0) * state.iterations());
  state.SetItemsProcessed(state.iterations() * operators.mass.size());
}

void solve(benchmark::State& state, Eigen::Index columns) {
  const Threads threads(state);
  const Operators& operators = operators_of(static_cast<int>(state.range(0)));
  const SparseCholesky cholesky(operators.shifted);
  const RowMatrix<double> rhs = RowMatrix<double>::Ones(operators.mass.size(), columns);
  for (auto _ : state) {
    const RowMatrix<double> x = cholesky.solve(rhs);
    benchmark::DoNotOptimize(x.data());
  }
  const auto entries = static_cast<double>(cholesky.factor_entries());
  const auto size = static_cast<double>(rhs.size());
  // Forward and back: each entry read twice, a product and a sum for every column.
  report(state, 4.0 * entries * static_cast<double>(columns),
         16.0 * entries + 2.0 * size * sizeof(double), size);
}

// 128 functions; the analysis is shared, as in `prepare`.
void basis(benchmark::State& state, EigenMethod method) {
  const Threads threads(state);
  const Operators& operators = operators_of(static_cast<int>(state.range(0)));
  const auto symbolic = std::make_shared<const SymbolicCholesky>(operators.laplacian);
  double residual = 0.0;
  for (auto _ : state) {
    const Eigenbasis found =
        eigenbasis(operators.laplacian, operators.mass, {.method = method}, {}, symbolic);
    residual = found.residual;
    if (found.method != method) {
      state.SetLabel(to_string(found.method));  // too small for the one asked for
    }
  }
  state.counters["residual"] = residual;
  state.SetItemsProcessed(state.iterations() * operators.mass.size() * 128);
}

constexpr int64_t kSmall[] = {1000, 10000};
constexpr int64_t kSizes[] = {1000, 10000, 40000, 160000};

void with_sizes(benchmark::internal::Benchmark* it, const int64_t* first, const int64_t* last) {
  it->ArgNames({"n", "threads"})->Unit(benchmark::kMillisecond)->UseRealTime();
  for (; first != last; ++first) {
    it->Args({*first, 1})->Args({*first, 2});
  }
}
void usual(benchmark::internal::Benchmark* it) {
  with_sizes(it, std::begin(kSizes), std::end(kSizes));
}
void small(benchmark::internal::Benchmark* it) {
  with_sizes(it, std::begin(kSmall), std::end(kSmall));
}
void large(benchmark::internal::Benchmark* it) {
  constexpr int64_t size = 1000000;
  with_sizes(it, &size, &size + 1);
}

BENCHMARK_TEMPLATE(transpose_product, double)->Apply(usual);
BENCHMARK_TEMPLATE(transpose_product, float)->Apply(usual);
BENCHMARK_TEMPLATE(add_product, double)->Apply(usual);
BENCHMARK_TEMPLATE(add_product, float)->Apply(usual);
BENCHMARK(project)->Apply(usual);
BENCHMARK(analyse)->Apply(usual);
BENCHMARK(factor)->Apply(usual);
BENCHMARK_CAPTURE(solve, columns_3, 3)->Apply(usual);
BENCHMARK_CAPTURE(solve, columns_16, 16)->Apply(usual);
BENCHMARK_CAPTURE(basis, block_krylov, EigenMethod::block_krylov)->Apply(usual);
BENCHMARK_CAPTURE(basis, multiresolution, EigenMethod::multiresolution)->Apply(usual);
BENCHMARK_CAPTURE(basis, lanczos, EigenMethod::lanczos)->Apply(small);

BENCHMARK(analyse)->Name("large/analyse")->Apply(large);
BENCHMARK(factor)->Name("large/factor")->Apply(large);
BENCHMARK_CAPTURE(solve, columns_3, 3)->Name("large/solve/columns_3")->Apply(large);
BENCHMARK_CAPTURE(solve, columns_16, 16)->Name("large/solve/columns_16")->Apply(large);
BENCHMARK_CAPTURE(basis, multiresolution, EigenMethod::multiresolution)
    ->Name("large/basis/multiresolution")
    ->Apply(large);

}  // namespace
}  // namespace supple
