// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/core/content_hash.h"

#include <gtest/gtest.h>

#include <string_view>

#include "native/support.h"

namespace supple {
namespace {

std::span<const std::byte> text(std::string_view characters) {
  return std::as_bytes(std::span(characters.data(), characters.size()));
}

TEST(ContentHash, Is32HexadecimalDigitsAndTheSameEveryTime) {
  const std::string hash = content_hash({text("ab"), text("c")});
  EXPECT_EQ(hash.size(), 32u);
  EXPECT_EQ(hash.find_first_not_of("0123456789abcdef"), std::string::npos);
  EXPECT_EQ(hash, content_hash({text("ab"), text("c")}));
}

TEST(ContentHash, KnowsWhereAPieceEnds) {
  EXPECT_NE(content_hash({text("ab"), text("c")}), content_hash({text("a"), text("bc")}));
  EXPECT_NE(content_hash({text("abc")}), content_hash({text("abc"), text("")}));
}

TEST(ContentHash, SeesTheLastBitOfAMatrix) {
  RowMatrix<double> matrix = test::noise(20, 3, 1);
  const std::string before = content_hash({bytes_of(matrix)});
  matrix(19, 2) = std::nextafter(matrix(19, 2), 2.0);
  EXPECT_NE(content_hash({bytes_of(matrix)}), before);
}

}  // namespace
}  // namespace supple
