// SPDX-License-Identifier: GPL-3.0-or-later
// Runs the benchmarks in the environment that the Python package sets up, see
// python/supple/_environment.py.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <cstdlib>

#include "supple/core/dense.h"
#include "supple/core/simd.h"

int main(int argc, char** argv) {
  if (std::getenv("OPENBLAS_CORETYPE") == nullptr) {
    const supple::SimdLevel level = supple::simd_level();
    setenv("OPENBLAS_CORETYPE",
           level == supple::SimdLevel::avx512 ? "SkylakeX"
           : level == supple::SimdLevel::avx2 ? "Haswell"
                                              : "Prescott",
           1);
    setenv("OMP_WAIT_POLICY", "passive", 0);
    execv("/proc/self/exe", argv);  // both are read before main
    return 1;
  }
  benchmark::AddCustomContext("simd", supple::to_string(supple::simd_level()));
  benchmark::AddCustomContext("blas", supple::blas_name());
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) {
    return 1;
  }
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
