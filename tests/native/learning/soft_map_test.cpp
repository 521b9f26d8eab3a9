// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/soft_map.h"

#include <sys/resource.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "learning/softmax.h"
#include "native/gradient_check.h"
#include "native/support.h"

namespace supple {
namespace {

// The definition, entry by entry in extended precision, whose exponentials do not overflow here.
RowMatrix<double> dense_soft_map(const RowMatrix<double>& source, const RowMatrix<double>& target,
                                 double temperature) {
  RowMatrix<double> map(source.rows(), target.rows());
  for (Eigen::Index i = 0; i < map.rows(); ++i) {
    std::vector<long double> weights;
    long double sum = 0.0L;
    for (Eigen::Index j = 0; j < map.cols(); ++j) {
      const double cosine =
          source.row(i).dot(target.row(j)) / (source.row(i).norm() * target.row(j).norm());
      weights.push_back(std::exp(static_cast<long double>(cosine) / temperature));
      sum += weights.back();
    }
    for (Eigen::Index j = 0; j < map.cols(); ++j) {
      map(i, j) = static_cast<double>(weights[static_cast<size_t>(j)] / sum);
    }
  }
  return map;
}

double largest_difference(const RowMatrix<double>& a, const RowMatrix<double>& b) {
  return (a - b).cwiseAbs().maxCoeff();
}

RowMatrix<double> identity(Eigen::Index n) { return RowMatrix<double>::Identity(n, n); }

TEST(SoftMap, IsTheSoftmaxOfTheProducts) {
  const RowMatrix<double> source = test::noise(13, 6, 1), target = test::noise(17, 6, 2);
  for (const double temperature : {10.0, 1.0, 0.07, 1e-3, 1e-4}) {  // exp(1e4): beyond double
    const RowMatrix<double> truth = dense_soft_map(source, target, temperature);
    ASSERT_TRUE(truth.allFinite());
    const SoftMap map(source, target, temperature);
    EXPECT_LT(largest_difference(map.apply(identity(17)), truth), 1e-10) << temperature;
    EXPECT_LT(largest_difference(map.apply_backward(identity(13)), truth.transpose()), 1e-10);
  }
}

TEST(Softmax, IsExactToRoundingAtEverySimdLevel) {
  test::at_every_simd_level([] {
    for (const Eigen::Index count : {1, 2, 3, 7, 8, 9, 31, 64, 77}) {
      const RowMatrix<double> start = test::noise(1, count, static_cast<uint64_t>(count));
      for (const double temperature : {1e-3, 0.07, 1.0, 1e3}) {
        std::vector<long double> truth;
        for (const double x : start.reshaped()) {
          truth.push_back(std::exp((static_cast<long double>(x) - start.maxCoeff()) / temperature));
        }
        const long double sum = std::accumulate(truth.begin(), truth.end(), 0.0L);
        RowMatrix<double> row = start;
        softmax(row.data(), count, temperature);
        for (Eigen::Index i = 0; i < count; ++i) {
          const auto expected = static_cast<double>(truth[static_cast<size_t>(i)] / sum);
          // The quotient x / temperature is rounded, and its error grows with it.
          EXPECT_NEAR(row(0, i), expected, expected * 1e-15 * (4.0 + 2.0 / temperature) + 1e-303);
        }
      }
    }
  });
}

TEST(SoftMap, TheLowestTemperaturesAreTheHardMap) {
  const RowMatrix<double> source = test::noise(13, 6, 1), target = test::noise(17, 6, 2);
  const SoftMap map(source, target, std::numeric_limits<double>::denorm_min());
  const RowMatrix<double> dense = map.apply(identity(17));
  const Eigen::VectorXi hard = map.hard_map();
  for (Eigen::Index i = 0; i < 13; ++i) {
    EXPECT_EQ(dense(i, hard[i]), 1.0);
    EXPECT_EQ(dense.row(i).sum(), 1.0);
  }
}

TEST(SoftMap, TheHardMapHasTheLargestWeights) {
  const RowMatrix<double> source = test::noise(60, 5, 1), target = test::noise(70, 5, 2);
  const RowMatrix<double> dense = dense_soft_map(source, target, 0.07);
  const Eigen::VectorXi hard = SoftMap(source, target).hard_map();
  for (Eigen::Index i = 0; i < dense.rows(); ++i) {
    Eigen::Index best = 0;
    dense.row(i).maxCoeff(&best);
    EXPECT_EQ(hard[i], best);
  }
}

TEST(SoftMap, BlocksJoinWithoutASeamSlow) {
  // Wide enough for several blocks, the last one shorter.
  const Eigen::Index n = 23, wide = 150000;
  const RowMatrix<double> source = test::noise(n, 3, 1), target = test::noise(wide, 3, 2);
  const RowMatrix<double> values = test::noise(wide, 2, 3), grad = test::noise(n, 2, 4);
  const SoftMap map(source, target, 0.3);
  ASSERT_LT(map.block_rows(), n / 2);
  ASSERT_NE(n % map.block_rows(), 0);
  const RowMatrix<double> dense = dense_soft_map(source, target, 0.3);
  EXPECT_LT(largest_difference(map.apply(values), dense * values), 1e-12);
  EXPECT_LT(largest_difference(map.apply(RowMatrix<double>::Ones(wide, 1)),
                               RowMatrix<double>::Ones(n, 1)),
            1e-12);
  EXPECT_LT(largest_difference(map.apply_backward(grad), dense.transpose() * grad), 1e-12);
  // One row at a time is another cut of the same sums.
  const SoftMap::Gradient whole = map.backward(values, grad);
  RowMatrix<double> target_grad = RowMatrix<double>::Zero(wide, 3);
  for (Eigen::Index i = 0; i < n; ++i) {
    const SoftMap::Gradient part =
        SoftMap(source.row(i), target, 0.3).backward(values, grad.row(i));
    EXPECT_LT(largest_difference(part.source, whole.source.row(i)), 1e-12);
    target_grad += part.target;
  }
  EXPECT_LT(largest_difference(target_grad, whole.target), 1e-12);
}

TEST(SoftMap, Gradients) {
  const test::Threads threads(1);  // far too small to share
  RowMatrix<double> source = test::noise(9, 4, 1), target = test::noise(11, 4, 2);
  RowMatrix<double> values = test::noise(11, 3, 3);
  const RowMatrix<double> direction = test::noise(9, 3, 4);
  for (const double temperature : {0.07, 0.5}) {
    const auto value = [&] {
      return SoftMap(source, target, temperature).apply(values).cwiseProduct(direction).sum();
    };
    const SoftMap map(source, target, temperature);
    const SoftMap::Gradient gradient = map.backward(values, direction);
    const RowMatrix<double> of_values = map.apply_backward(direction);
    EXPECT_TRUE(
        test::gradient_matches(value, test::values_of(source), test::values_of(gradient.source)));
    EXPECT_TRUE(
        test::gradient_matches(value, test::values_of(target), test::values_of(gradient.target)));
    EXPECT_TRUE(test::gradient_matches(value, test::values_of(values), test::values_of(of_values)));
  }
}

TEST(SoftMap, DoesNotSeeLengthsOrTheChoiceOfChannels) {
  const RowMatrix<double> source = test::noise(13, 3, 1), target = test::noise(17, 3, 2);
  const RowMatrix<double> values = test::noise(17, 2, 3);
  const RowMatrix<double> pulled = SoftMap(source, target).apply(values);
  EXPECT_LT(largest_difference(SoftMap(7.0 * source, 1e-5 * target).apply(values), pulled), 1e-12);
  EXPECT_LT(
      largest_difference(
          SoftMap(source * test::rotation(1), target * test::rotation(1)).apply(values), pulled),
      1e-12);
}

TEST(SoftMap, FollowsTheOrderOfVertices) {
  const RowMatrix<double> source = test::noise(13, 5, 1), target = test::noise(17, 5, 2);
  const RowMatrix<double> values = test::noise(17, 2, 3);
  const RowMatrix<double> pulled = SoftMap(source, target).apply(values);
  EXPECT_LT(
      largest_difference(
          SoftMap(source, target.colwise().reverse()).apply(values.colwise().reverse()), pulled),
      1e-12);
  EXPECT_LT(largest_difference(SoftMap(source.colwise().reverse(), target).apply(values),
                               pulled.colwise().reverse()),
            1e-12);
}

TEST(SoftMap, SameThreadsSameBytes) {
  const RowMatrix<double> source = test::noise(400, 16, 1), target = test::noise(5000, 16, 2);
  const RowMatrix<double> values = test::noise(5000, 8, 3), grad = test::noise(400, 8, 4);
  const test::Threads threads(2);
  const SoftMap map(source, target);
  ASSERT_LT(map.block_rows(), 400);
  EXPECT_EQ(map.apply(values), map.apply(values));
  const SoftMap::Gradient a = map.backward(values, grad), b = map.backward(values, grad);
  EXPECT_EQ(a.source, b.source);
  EXPECT_EQ(a.target, b.target);
}

TEST(SoftMap, NeverHoldsTheWholeMapSlow) {
  const auto peak_megabytes = [] {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return static_cast<double>(usage.ru_maxrss) / 1024.0;
  };
  const Eigen::Index n = 10000;  // the map would take 800 MB
  const RowMatrix<double> source = test::noise(n, 8, 1), target = test::noise(n, 8, 2);
  const double before = peak_megabytes();
  const SoftMap map(source, target);
  EXPECT_LE(map.block_rows() * n, Eigen::Index{1} << 20);
  const RowMatrix<double> pulled = map.apply(target);
  map.backward(target, pulled);
  EXPECT_LT(peak_megabytes() - before, 60.0);
}

TEST(SoftMap, ReportsAndCanBeCancelled) {
  const SoftMap map(test::noise(13, 5, 1), test::noise(17, 5, 2));
  const RowMatrix<double> values = test::noise(17, 2, 3), grad = test::noise(13, 2, 3);
  Progress progress;
  map.apply(values, ProgressRange(&progress));
  EXPECT_DOUBLE_EQ(progress.fraction(), 1.0);
  Progress cancelled;
  cancelled.cancel();
  EXPECT_TRUE(test::fails_with(ErrorCode::cancelled, {},
                               [&] { map.apply(values, ProgressRange(&cancelled)); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::cancelled, {},
                               [&] { map.backward(values, grad, ProgressRange(&cancelled)); }));
}

TEST(SoftMap, RefusesWhatHasNoMeaning) {
  const RowMatrix<double> source = test::noise(13, 5, 1), target = test::noise(17, 5, 2);
  for (const double temperature : {0.0, -0.07, std::nan("")}) {
    EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"temperature"},
                                 [&] { SoftMap(source, target, temperature); }));
  }
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"13 x 4", "17 x 5"},
                               [&] { SoftMap(source.leftCols(4), target); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"0 x 5"},
                               [&] { SoftMap(source.topRows(0), target); }));
  RowMatrix<double> broken = target;
  broken(3, 1) = std::nan("");
  EXPECT_TRUE(test::fails_with(ErrorCode::not_finite, {"Row 3", "target"},
                               [&] { SoftMap(source, broken); }));
  broken.row(3).setZero();
  EXPECT_TRUE(test::fails_with(ErrorCode::not_finite, {"Row 3", "source", "no direction"},
                               [&] { SoftMap(broken, target); }));
  const SoftMap map(source, target);
  EXPECT_TRUE(
      test::fails_with(ErrorCode::wrong_shape, {"13 rows", "17"}, [&] { map.apply(source); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"17 rows", "13"},
                               [&] { map.apply_backward(target); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"4 columns", "5"},
                               [&] { map.backward(target, source.leftCols(4)); }));
}

}  // namespace
}  // namespace supple
