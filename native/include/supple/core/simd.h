// SPDX-License-Identifier: GPL-3.0-or-later
// Kernels compiled for several instruction sets, of which the machine's best is chosen when it
// runs: one wheel for every x86-64, and fast on the newest.
//
// A kernel is a template body<Bytes>, marked SUPPLE_INLINE, on vectors of that many bytes
// (`Lanes`), and three functions that call it, marked SUPPLE_AVX512 (64), SUPPLE_AVX2 (32) and
// nothing (16); `best_kernel` chooses. Clones made by the compiler from one source would share one
// vector type, and a type wider than the registers lives in memory. No OpenMP region inside a
// kernel: its body would be compiled for plain x86-64.
#pragma once

#include <cstddef>

#if defined(__x86_64__) && defined(__GNUC__)
#define SUPPLE_X86 1
#define SUPPLE_AVX512 __attribute__((target("avx512f,avx512dq,avx512vl,avx512bw,avx2,fma")))
#define SUPPLE_AVX2 __attribute__((target("avx2,fma")))
#else
#define SUPPLE_AVX512
#define SUPPLE_AVX2
#endif
#define SUPPLE_INLINE inline __attribute__((always_inline))

namespace supple {

/// A vector of Bytes / sizeof(Scalar) numbers with the usual operators.
template <class Scalar, int Bytes>
struct Lanes {
  typedef Scalar type __attribute__((vector_size(Bytes)));
  static constexpr int count = Bytes / static_cast<int>(sizeof(Scalar));
};

enum class SimdLevel { plain, avx2, avx512 };
/// What this machine has, or the lesser one that SUPPLE_SIMD in the environment names.
SimdLevel simd_level();
const char* to_string(SimdLevel level);

/// The one of three functions to use at `simd_level()`.
template <class Function>
Function best_kernel(Function avx512, Function avx2, Function plain) {
  const SimdLevel level = simd_level();
  return level == SimdLevel::avx512 ? avx512 : level == SimdLevel::avx2 ? avx2 : plain;
}

}  // namespace supple
