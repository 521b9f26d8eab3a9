// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>

#include "supple/core/simd.h"

namespace supple {

/// Faces or vertices whose data are asked for ahead of a loop that gathers them: in meshes whose
/// order is not one of neighbours, each lies somewhere else in memory, and the loop would wait.
constexpr int kAhead = 8;

/// Asks for some bytes to be read into the cache. They must belong to one array.
SUPPLE_INLINE void prefetch(const void* begin, size_t bytes) {
  constexpr size_t kLine = 64;
  const auto* const first = static_cast<const char*>(begin);
  for (size_t i = 0; i < bytes; i += kLine) {
    __builtin_prefetch(first + i);
  }
}

}  // namespace supple
