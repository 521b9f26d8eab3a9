// SPDX-License-Identifier: GPL-3.0-or-later
// Random draws that are the same on every platform; the library's distributions differ.
#pragma once

#include <cstdint>
#include <random>
#include <utility>
#include <vector>

namespace supple {

/// Uniform in [0, count), count >= 1.
inline int draw(std::mt19937_64& generator, int count) {
  return static_cast<int>(generator() % static_cast<uint64_t>(count));
}

/// A random order of the items. Source: Fisher and Yates.
template <class Item>
void shuffle(std::mt19937_64& generator, std::vector<Item>& items) {
  for (int i = static_cast<int>(items.size()) - 1; i > 0; --i) {
    std::swap(items[static_cast<size_t>(i)], items[static_cast<size_t>(draw(generator, i + 1))]);
  }
}

}  // namespace supple
