// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/core/progress.h"

#include <gtest/gtest.h>

#include "native/support.h"

namespace supple {
namespace {

TEST(Progress, StagesShareTheRange) {
  Progress progress;
  const ProgressRange whole(&progress);
  const ProgressRange second = whole.stage("second", 0.5, 1.0);
  EXPECT_EQ(progress.stage(), "second");
  EXPECT_DOUBLE_EQ(progress.fraction(), 0.5);
  second.report(0.5);
  EXPECT_DOUBLE_EQ(progress.fraction(), 0.75);
  second.stage("inner", 0.5, 1.0).report(1.0);
  EXPECT_EQ(progress.stage(), "inner");
  EXPECT_DOUBLE_EQ(progress.fraction(), 1.0);
}

TEST(Progress, NeverGoesBack) {
  Progress progress;
  const ProgressRange whole(&progress);
  whole.report(0.6);
  whole.report(0.2);
  EXPECT_DOUBLE_EQ(progress.fraction(), 0.6);
  whole.report(7.0);
  EXPECT_DOUBLE_EQ(progress.fraction(), 1.0);
}

TEST(Progress, CancelThrowsAtTheNextReport) {
  Progress progress;
  const ProgressRange whole(&progress);
  whole.report(0.1);
  progress.cancel();
  EXPECT_TRUE(progress.cancelled());
  EXPECT_TRUE(test::fails_with(ErrorCode::cancelled, {}, [&] { whole.report(0.2); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::cancelled, {}, [&] { whole.stage("next", 0.5, 1.0); }));
}

TEST(Progress, NoEstimateBeforeTwoPercent) {
  Progress progress;
  const ProgressRange range = ProgressRange(&progress).stage("work", 0.0, 1.0);
  range.report(0.01);
  EXPECT_FALSE(progress.seconds_left().has_value());
  range.report(0.5);
  ASSERT_TRUE(progress.seconds_left().has_value());
  EXPECT_GE(*progress.seconds_left(), 0.0);
  range.report(1.0);
  EXPECT_DOUBLE_EQ(*progress.seconds_left(), 0.0);
}

TEST(Progress, ADefaultRangeReportsToNobody) {
  const ProgressRange nobody;
  EXPECT_NO_THROW(nobody.report(0.5));
  EXPECT_NO_THROW(nobody.stage("quiet", 0.0, 1.0).report(1.0));
}

}  // namespace
}  // namespace supple
