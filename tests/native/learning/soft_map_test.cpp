// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/soft_map.h"

#include <sys/resource.h>

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "learning/soft_weights.h"
#include "native/gradient_check.h"
#include "native/support.h"

namespace supple {
namespace {

using Pair = std::array<RowMatrix<double>, 2>;

// The definition, entry by entry in extended precision, whose exponentials do not overflow here.
RowMatrix<double> dense_soft_map(const RowMatrix<double>& source, const RowMatrix<double>& target,
                                 double temperature) {
  const RowMatrix<double> cosines =
      source.rowwise().normalized() * target.rowwise().normalized().transpose();
  RowMatrix<double> map(source.rows(), target.rows());
  for (Eigen::Index i = 0; i < map.rows(); ++i) {
    std::vector<long double> weights;
    long double sum = 0.0L;
    for (Eigen::Index j = 0; j < map.cols(); ++j) {
      weights.push_back(std::exp(static_cast<long double>(cosines(i, j)) / temperature));
      sum += weights.back();
    }
    for (Eigen::Index j = 0; j < map.cols(); ++j) {
      map(i, j) = static_cast<double>(weights[static_cast<size_t>(j)] / sum);
    }
  }
  return map;
}

// The definition of the gradient with respect to both features, from dense soft maps: of the sum of
// grad[d] o (P_d values[1 - d]).
Pair dense_gradient(const Pair& features, const Pair& values, const Pair& grad,
                    double temperature) {
  Pair unit, result;
  for (size_t s = 0; s < 2; ++s) {
    unit[s] = features[s].rowwise().normalized();
    result[s].setZero(unit[s].rows(), unit[s].cols());
  }
  for (size_t d = 0; d < 2; ++d) {
    const RowMatrix<double> map = dense_soft_map(features[d], features[1 - d], temperature);
    const RowMatrix<double> of_map = grad[d] * values[1 - d].transpose();
    const Eigen::VectorXd mean = map.cwiseProduct(of_map).rowwise().sum();
    const RowMatrix<double> of_products = map.cwiseProduct(of_map.colwise() - mean) / temperature;
    result[d] += of_products * unit[1 - d];
    result[1 - d] += of_products.transpose() * unit[d];
  }
  for (size_t s = 0; s < 2; ++s) {
    for (Eigen::Index i = 0; i < unit[s].rows(); ++i) {
      const Eigen::RowVectorXd u = unit[s].row(i), g = result[s].row(i);
      result[s].row(i) = (g - u * u.dot(g)) / features[s].row(i).norm();
    }
  }
  return result;
}

double largest_difference(const RowMatrix<double>& a, const RowMatrix<double>& b) {
  return (a - b).cwiseAbs().maxCoeff();
}

RowMatrix<double> identity(Eigen::Index n) { return RowMatrix<double>::Identity(n, n); }

template <class Scalar>
std::array<RowMatrix<Scalar>, 2> as(const Pair& pair) {
  return {pair[0].cast<Scalar>(), pair[1].cast<Scalar>()};
}

// What `backward` says of values that `apply` pulled back just before.
template <class Scalar>
Pair gradient_of(const SoftMapPair<Scalar>& maps, const Pair& values, const Pair& grad) {
  const auto gradient =
      maps.backward(as<Scalar>(values), maps.apply(as<Scalar>(values)), as<Scalar>(grad));
  return {gradient[0].template cast<double>(), gradient[1].template cast<double>()};
}

// Of more rows than a tile has, and of another number of columns on each surface.
struct Large {
  Pair features{test::noise(520, 24, 1), test::noise(530, 24, 2)};
  Pair values{test::noise(520, 5, 3), test::noise(530, 7, 4)};
  Pair grad{test::noise(520, 7, 5), test::noise(530, 5, 6)};
};

TEST(SoftMapPair, IsTheSoftmaxOfTheProductsInBothDirections) {
  const RowMatrix<double> first = test::noise(13, 6, 1), second = test::noise(17, 6, 2);
  for (const double temperature : {10.0, 1.0, 0.07, 1e-3, 1e-4}) {  // exp(1e4): beyond double
    const RowMatrix<double> there = dense_soft_map(first, second, temperature);
    const RowMatrix<double> back = dense_soft_map(second, first, temperature);
    ASSERT_TRUE(there.allFinite() && back.allFinite());
    const SoftMapPair<double> maps(first, second, temperature);
    const auto pulled = maps.apply({identity(13), identity(17)});
    EXPECT_LT(largest_difference(pulled[0].values, there), 1e-10) << temperature;
    EXPECT_LT(largest_difference(pulled[1].values, back), 1e-10) << temperature;
  }
}

// What `apply` should return for the large ones' values.
Pair dense_pulled(const Large& large, double temperature) {
  Pair pulled;
  for (size_t d = 0; d < 2; ++d) {
    pulled[d] =
        dense_soft_map(large.features[d], large.features[1 - d], temperature) * large.values[1 - d];
  }
  return pulled;
}

TEST(SoftMapPair, TilesJoinWithoutASeam) {
  const Large large;
  for (const double temperature : {0.3, 1e-3}) {  // one exponential, two
    const Pair truth = dense_pulled(large, temperature);
    const Pair true_gradient =
        dense_gradient(large.features, large.values, large.grad, temperature);
    for (const int count : {1, 2, 3}) {
      const test::Threads threads(count);
      const SoftMapPair<double> maps(large.features[0], large.features[1], temperature);
      const auto pulled = maps.apply(large.values);
      const Pair gradient = gradient_of(maps, large.values, large.grad);
      for (size_t d = 0; d < 2; ++d) {
        EXPECT_LT(largest_difference(pulled[d].values, truth[d]), 1e-10);
        EXPECT_LT(largest_difference(gradient[d], true_gradient[d]),
                  1e-10 * true_gradient[d].norm());
      }
    }
  }
}

// A product is good to about 1e-7, and a weight to that part of the temperature.
TEST(SoftMapPair, SinglePrecisionIsThatOfTheProducts) {
  const Large large;
  const auto features = as<float>(large.features);
  for (const double temperature : {0.07, 0.033, 1e-3}) {
    const double tolerance = 1e-6 + 3e-7 / temperature;
    const SoftMapPair<float> maps(features[0], features[1], temperature);
    const auto pulled = maps.apply(as<float>(large.values));
    const Pair gradient = gradient_of(maps, large.values, large.grad);
    const Pair truth = dense_pulled(large, temperature);
    const Pair true_gradient =
        dense_gradient(large.features, large.values, large.grad, temperature);
    for (size_t d = 0; d < 2; ++d) {
      EXPECT_LT(largest_difference(pulled[d].values.cast<double>(), truth[d]), tolerance)
          << temperature;
      EXPECT_LT((gradient[d] - true_gradient[d]).norm(), tolerance * true_gradient[d].norm())
          << temperature;
    }
  }
}

template <class Scalar>
void weights_are_exact_to_rounding(double rounding, double least) {
  for (const Eigen::Index count : {1, 2, 3, 7, 8, 9, 31, 64, 77}) {
    const RowMatrix<Scalar> x =
        test::noise(1, count, static_cast<uint64_t>(count)).template cast<Scalar>();
    for (const double temperature : {1e-3, 0.07, 1.0, 1e3}) {
      RowMatrix<Scalar> weights(1, count);
      const auto t = static_cast<Scalar>(temperature);
      soft_weights(x.data(), count, x.maxCoeff(), t, weights.data());
      for (Eigen::Index i = 0; i < count; ++i) {
        const auto expected =
            static_cast<double>(std::exp((static_cast<long double>(x(0, i)) - x.maxCoeff()) / t));
        // The difference and its quotient are rounded, and the error grows with them.
        EXPECT_NEAR(static_cast<double>(weights(0, i)), expected,
                    expected * rounding * (4.0 + 2.0 / temperature) + least);
      }
    }
  }
}

TEST(SoftWeights, AreExactToRoundingAtEverySimdLevel) {
  test::at_every_simd_level([] {
    weights_are_exact_to_rounding<double>(1e-15, 1e-303);
    weights_are_exact_to_rounding<float>(1e-7, 1e-37);
  });
}

template <class Scalar>
void lowest_temperatures_are_the_hard_map() {
  const Pair features = {test::noise(13, 6, 1), test::noise(17, 6, 2)};
  const auto given = as<Scalar>(features);
  const SoftMapPair<Scalar> maps(given[0], given[1], std::numeric_limits<double>::denorm_min());
  const auto pulled = maps.apply(as<Scalar>(Pair{identity(13), identity(17)}));
  for (size_t d = 0; d < 2; ++d) {
    const Eigen::VectorXi hard = maps.hard_map(d);
    for (Eigen::Index i = 0; i < maps.rows(d); ++i) {
      EXPECT_EQ(pulled[d].values(i, hard[i]), Scalar(1));
      EXPECT_EQ(pulled[d].values.row(i).sum(), Scalar(1));
    }
  }
}

TEST(SoftMapPair, TheLowestTemperaturesAreTheHardMap) {
  lowest_temperatures_are_the_hard_map<double>();
  lowest_temperatures_are_the_hard_map<float>();
}

TEST(SoftMapPair, TheHardMapHasTheLargestWeights) {
  const Pair features = {test::noise(60, 5, 1), test::noise(70, 5, 2)};
  const SoftMapPair<double> maps(features[0], features[1]);
  for (size_t d = 0; d < 2; ++d) {
    const RowMatrix<double> dense = dense_soft_map(features[d], features[1 - d], 0.07);
    const Eigen::VectorXi hard = maps.hard_map(d);
    for (Eigen::Index i = 0; i < dense.rows(); ++i) {
      Eigen::Index best = 0;
      dense.row(i).maxCoeff(&best);
      EXPECT_EQ(hard[i], best);
    }
  }
}

TEST(SoftMapPair, Gradients) {
  const test::Threads threads(1);  // far too small to share
  Pair features = {test::noise(9, 4, 1), test::noise(11, 4, 2)};
  const Pair values = {test::noise(9, 2, 3), test::noise(11, 3, 4)};
  const Pair grad = {test::noise(9, 3, 5), test::noise(11, 2, 6)};
  for (const double temperature : {0.07, 0.5}) {
    const auto value = [&] {
      const auto pulled = SoftMapPair<double>(features[0], features[1], temperature).apply(values);
      return pulled[0].values.cwiseProduct(grad[0]).sum() +
             pulled[1].values.cwiseProduct(grad[1]).sum();
    };
    const Pair gradient =
        gradient_of(SoftMapPair<double>(features[0], features[1], temperature), values, grad);
    for (size_t s = 0; s < 2; ++s) {
      EXPECT_TRUE(test::gradient_matches(value, test::values_of(features[s]),
                                         test::values_of(gradient[s])));
    }
  }
}

TEST(SoftMapPair, ADirectionLeftOutIsZero) {
  const Large large;
  const RowMatrix<double> none;
  for (const double temperature : {0.07, 1e-3}) {
    const SoftMapPair<double> maps(large.features[0], large.features[1], temperature);
    const auto both = maps.apply(large.values);
    const auto there = maps.apply({none, large.values[1]});
    const auto back = maps.apply({large.values[0], none});
    EXPECT_EQ(there[0].values, both[0].values);
    EXPECT_EQ(there[0].sums, both[0].sums);
    EXPECT_EQ(there[1].values.size() + there[1].sums.size(), 0);
    EXPECT_EQ(back[1].values, both[1].values);
    EXPECT_EQ(back[0].values.size() + back[0].sums.size(), 0);
    const auto whole = maps.backward(large.values, both, large.grad);
    const auto of_there = maps.backward({none, large.values[1]}, there, {large.grad[0], none});
    const auto of_back = maps.backward({large.values[0], none}, back, {none, large.grad[1]});
    const auto of_none = maps.backward({}, {}, {});
    for (size_t s = 0; s < 2; ++s) {
      EXPECT_LT(largest_difference(of_there[s] + of_back[s], whole[s]), 1e-12 * whole[s].norm());
      EXPECT_TRUE(of_none[s].isZero());
      EXPECT_EQ(of_none[s].rows(), maps.rows(s));
    }
  }
}

TEST(SoftMapPair, DoesNotSeeLengthsOrTheChoiceOfChannels) {
  const RowMatrix<double> first = test::noise(13, 3, 1), second = test::noise(17, 3, 2);
  const Pair values = {test::noise(13, 2, 3), test::noise(17, 2, 4)};
  const auto pulled = SoftMapPair<double>(first, second).apply(values);
  const auto scaled = SoftMapPair<double>(7.0 * first, 1e-5 * second).apply(values);
  const auto turned =
      SoftMapPair<double>(first * test::rotation(1), second * test::rotation(1)).apply(values);
  for (size_t d = 0; d < 2; ++d) {
    EXPECT_LT(largest_difference(scaled[d].values, pulled[d].values), 1e-12);
    EXPECT_LT(largest_difference(turned[d].values, pulled[d].values), 1e-12);
  }
}

TEST(SoftMapPair, FollowsTheOrderOfVerticesAndOfSurfaces) {
  const RowMatrix<double> first = test::noise(13, 5, 1), second = test::noise(17, 5, 2);
  const Pair values = {test::noise(13, 2, 3), test::noise(17, 2, 4)};
  const auto pulled = SoftMapPair<double>(first, second).apply(values);
  const auto reversed = SoftMapPair<double>(first, second.colwise().reverse())
                            .apply({values[0], values[1].colwise().reverse()});
  EXPECT_LT(largest_difference(reversed[0].values, pulled[0].values), 1e-12);
  EXPECT_LT(largest_difference(reversed[1].values, pulled[1].values.colwise().reverse()), 1e-12);
  const auto swapped = SoftMapPair<double>(second, first).apply({values[1], values[0]});
  for (size_t d = 0; d < 2; ++d) {
    EXPECT_LT(largest_difference(swapped[1 - d].values, pulled[d].values), 1e-12);
  }
}

TEST(SoftMapPair, SameThreadsSameBytes) {
  const Large large;
  const auto features = as<float>(large.features), values = as<float>(large.values),
             grad = as<float>(large.grad);
  const test::Threads threads(2);
  for (const double temperature : {0.07, 1e-3}) {
    const auto run = [&] {
      const SoftMapPair<float> maps(features[0], features[1], temperature);
      const auto pulled = maps.apply(values);
      const auto gradient = maps.backward(values, pulled, grad);
      return std::array{pulled[0].values, pulled[1].values, gradient[0], gradient[1]};
    };
    const auto a = run(), b = run();
    for (size_t i = 0; i < a.size(); ++i) {
      EXPECT_EQ(a[i], b[i]);
    }
  }
}

TEST(SoftMapPair, NeverHoldsTheWholeMapSlow) {
  const auto peak_megabytes = [] {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return static_cast<double>(usage.ru_maxrss) / 1024.0;
  };
  const Eigen::Index n = 10000;  // the map would take 800 MB
  const Pair features = {test::noise(n, 8, 1), test::noise(n, 8, 2)};
  const double before = peak_megabytes();
  gradient_of(SoftMapPair<double>(features[0], features[1]), features, features);
  EXPECT_LT(peak_megabytes() - before, 60.0);
}

TEST(SoftMapPair, ReportsAndCanBeCancelled) {
  const Large large;
  const auto& [first, second] = large.features;
  const test::Threads threads(2);
  const SoftMapPair<double> maps(first, second);
  Progress progress;
  const auto pulled = maps.apply(large.values, ProgressRange(&progress));
  EXPECT_DOUBLE_EQ(progress.fraction(), 1.0);
  Progress cancelled;
  cancelled.cancel();
  const ProgressRange range(&cancelled);
  EXPECT_TRUE(test::fails_with(ErrorCode::cancelled, {}, [&] { maps.apply(large.values, range); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::cancelled, {},
                               [&] { maps.backward(large.values, pulled, large.grad, range); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::cancelled, {},
                               [&] { SoftMapPair<double>(first, second, 1e-3, range); }));
}

TEST(SoftMapPair, RefusesWhatHasNoMeaning) {
  const RowMatrix<double> first = test::noise(13, 5, 1), second = test::noise(17, 5, 2), none;
  for (const double temperature : {0.0, -0.07, std::nan("")}) {
    EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"temperature"},
                                 [&] { SoftMapPair<double>(first, second, temperature); }));
  }
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"13 x 4", "17 x 5"},
                               [&] { SoftMapPair<double>(first.leftCols(4), second); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"0 x 5"},
                               [&] { SoftMapPair<double>(first.topRows(0), second); }));
  RowMatrix<double> broken = second;
  broken(3, 1) = std::nan("");
  EXPECT_TRUE(test::fails_with(ErrorCode::not_finite, {"Row 3", "second"},
                               [&] { SoftMapPair<double>(first, broken); }));
  broken.row(3).setZero();
  EXPECT_TRUE(test::fails_with(ErrorCode::not_finite, {"Row 3", "first", "no direction"},
                               [&] { SoftMapPair<double>(broken, second); }));
  const SoftMapPair<double> maps(first, second);
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"surface 1", "13 x 5", "17 x 5"}, [&] {
    maps.apply({first, first});
  }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"0 rows"}, [&] {
    maps.apply({none, none});
  }));
  const auto pulled = maps.apply({first, second});
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"gradients", "13 x 4", "13 x 5"}, [&] {
    maps.backward({first, second}, pulled, {first.leftCols(4), none});
  }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"pulled back", "0 x 0", "13 x 5"}, [&] {
    maps.backward({first, second}, {}, {first, none});
  }));
}

}  // namespace
}  // namespace supple
