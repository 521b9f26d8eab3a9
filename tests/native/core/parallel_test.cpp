// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/core/parallel.h"

#include <algorithm>
#include <atomic>
#include <vector>

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

TEST(RunAtOnce, TakesEachStepOnceWithAThreadOfItsOwn) {
  const int before = thread_count();
  for (const int threads : {1, 3}) {
    set_thread_count(threads);
    std::vector<std::atomic<int>> taken(50);
    std::atomic<int> largest = 0;
    run_at_once(taken.size(), [&](size_t i) {
      ++taken[i];
      largest = std::max<int>(largest, thread_count());
    });
    for (const auto& times : taken) {
      EXPECT_EQ(times, 1);
    }
    EXPECT_EQ(largest, 1);
    EXPECT_EQ(thread_count(), threads);
  }
  set_thread_count(before);
  run_at_once(0, [](size_t) { FAIL() << "there is no step"; });
}

TEST(RunAtOnce, ThrowsWhatAStepThrewAndBeginsNoOther) {
  const int before = thread_count();
  set_thread_count(1);
  int taken = 0;
  EXPECT_TRUE(test::fails_with(ErrorCode::cancelled, {}, [&] {
    run_at_once(5, [&](size_t i) {
      ++taken;
      if (i == 1) {
        throw Error(ErrorCode::cancelled, "stopped");
      }
    });
  }));
  EXPECT_EQ(taken, 2);
  set_thread_count(3);
  EXPECT_TRUE(test::fails_with(ErrorCode::cancelled, {}, [] {
    run_at_once(5, [](size_t) { throw Error(ErrorCode::cancelled, "stopped"); });
  }));
  set_thread_count(before);
}

}  // namespace
}  // namespace supple
