// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/core/error.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace supple {
namespace {

TEST(Error, EveryCodeHasItsOwnName) {
  std::set<std::string> names;
  for (int code = 0; code <= static_cast<int>(ErrorCode::cancelled); ++code) {
    const std::string name = to_string(static_cast<ErrorCode>(code));
    EXPECT_NE(name, "unknown") << "code " << code;
    EXPECT_TRUE(names.insert(name).second) << name << " twice";
  }
}

TEST(Error, CarriesCodeAndMessage) {
  const Error error(ErrorCode::singular_matrix, "Handle 'hand' has no inverse.");
  EXPECT_EQ(error.code(), ErrorCode::singular_matrix);
  EXPECT_STREQ(error.what(), "Handle 'hand' has no inverse.");
}

}  // namespace
}  // namespace supple
