// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "supple/core/simd.h"

namespace supple {

/// Faces or vertices whose data are asked for ahead of a loop that gathers them: in meshes whose
/// order is not one of neighbours, each lies somewhere else in memory, and the loop would wait.
constexpr int kAhead = 8;

/// Asks for some bytes to be read into the cache. They must belong to one array.
SUPPLE_INLINE void prefetch(const void* begin, size_t bytes) {
  constexpr size_t kLine = 64;
  const auto first = reinterpret_cast<uintptr_t>(begin);
  for (uintptr_t line = first / kLine * kLine; line < first + bytes; line += kLine) {
    __builtin_prefetch(reinterpret_cast<const void*>(line));
  }
}

}  // namespace supple
