// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/core/parallel.h"

#include "native/support.h"

namespace supple {
namespace {

TEST(ThreadCount, IsWhatWasSet) {
  const int before = thread_count();
  EXPECT_GE(before, 1);
  set_thread_count(3);
  EXPECT_EQ(thread_count(), 3);
  set_thread_count(before);
  EXPECT_EQ(thread_count(), before);
}

TEST(ThreadCountErrors, NoThreads) {
  const int before = thread_count();
  for (const int count : {0, -2}) {
    EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {std::to_string(count).c_str(), "1"},
                                 [&] { set_thread_count(count); }));
  }
  EXPECT_EQ(thread_count(), before);
}

}  // namespace
}  // namespace supple
