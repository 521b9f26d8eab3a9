// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <initializer_list>
#include <span>
#include <string>

namespace supple {

/// 32 hexadecimal digits that name pieces of memory: XXH3 with 128 bits over each piece's size and
/// bytes, so that moving a byte from one piece to the next is another name. Against accidents, not
/// attackers.
std::string content_hash(std::initializer_list<std::span<const std::byte>> pieces);

/// The bytes of a dense matrix or vector, as they lie in memory.
template <class Matrix>
std::span<const std::byte> bytes_of(const Matrix& matrix) {
  return std::as_bytes(std::span(matrix.data(), static_cast<size_t>(matrix.size())));
}

}  // namespace supple
