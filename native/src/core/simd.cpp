// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/core/simd.h"

#include <algorithm>
#include <cstdlib>
#include <string>

namespace supple {
namespace {

SimdLevel machine_level() {
#ifdef SUPPLE_X86
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw")) {
    return SimdLevel::avx512;
  }
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
    return SimdLevel::avx2;
  }
#endif
  return SimdLevel::plain;
}

SimdLevel allowed_level() {
  const char* const asked = std::getenv("SUPPLE_SIMD");
  for (const SimdLevel level : {SimdLevel::plain, SimdLevel::avx2}) {
    if (asked != nullptr && to_string(level) == std::string(asked)) {
      return level;
    }
  }
  return SimdLevel::avx512;
}

}  // namespace

SimdLevel simd_level() {
  static const SimdLevel level = std::min(machine_level(), allowed_level());
  return level;
}

const char* to_string(SimdLevel level) {
  switch (level) {
    case SimdLevel::plain:
      return "plain";
    case SimdLevel::avx2:
      return "avx2";
    default:
      return "avx512";
  }
}

}  // namespace supple
