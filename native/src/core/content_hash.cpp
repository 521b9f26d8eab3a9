// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/core/content_hash.h"

#include <cstdint>
#include <cstdio>

#include "xxh3.h"

namespace supple {

std::string content_hash(std::initializer_list<std::span<const std::byte>> pieces) {
  XXH3_state_t state;
  XXH3_128bits_reset(&state);
  for (const std::span<const std::byte> piece : pieces) {
    const auto size = static_cast<uint64_t>(piece.size());
    XXH3_128bits_update(&state, &size, sizeof(size));
    XXH3_128bits_update(&state, piece.data(), piece.size());
  }
  const XXH128_hash_t hash = XXH3_128bits_digest(&state);
  char digits[33];
  std::snprintf(digits, sizeof(digits), "%016llx%016llx",
                static_cast<unsigned long long>(hash.high64),
                static_cast<unsigned long long>(hash.low64));
  return digits;
}

}  // namespace supple
