// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/trainer.h"

#include <limits>
#include <set>
#include <tuple>

#include "native/support.h"

namespace supple {
namespace {

using Kind = std::tuple<Configuration, SignalKind>;

std::vector<TrainingPair> tiny_pairs() {
  const zoo::Mesh a = zoo::perturbed_sphere(1, 3), b = zoo::open_cylinder(8, 5);
  return {{a.vertices, a.faces, test::bent(a.vertices)},
          {b.vertices, b.faces, test::bent(b.vertices)}};
}

TrainOptions tiny_options(Configuration configuration, SignalKind signal) {
  TrainOptions options;
  options.architecture = {
      .configuration = configuration, .signal = signal, .eigenfunctions = 16, .width = 16};
  options.epochs = 40;
  options.first_learning_rate = 2e-3;
  options.last_learning_rate = 1e-4;
  options.samples = configuration == Configuration::paper ? 0 : 30;
  options.fewest_eigenfunctions = 6;
  options.most_eigenfunctions = 12;
  options.seed = 4;
  return options;
}

class Training : public ::testing::TestWithParam<Kind> {
 protected:
  TrainOptions options = tiny_options(std::get<0>(GetParam()), std::get<1>(GetParam()));
};

TEST_P(Training, ReducesTheLoss) {
  options.epochs = 300;
  const auto pairs = tiny_pairs();
  Trainer<float> trainer({pairs[0]}, options);
  ASSERT_EQ(trainer.total_steps(), 300);
  double first = 0.0, last = 0.0;
  for (int step = 0; step < 300; ++step) {
    const double total = trainer.step().loss.total;
    first += step < 10 ? total : 0.0;
    last += step >= 290 ? total : 0.0;
  }
  EXPECT_LT(last, 0.8 * first);
}

TEST_P(Training, SameSeedSameBytes) {
  options.epochs = 5;
  Trainer<float> a(tiny_pairs(), options), b(tiny_pairs(), options);
  for (int step = 0; step < a.total_steps(); ++step) {
    const TrainStep sa = a.step(), sb = b.step();
    EXPECT_EQ(sa.loss.total, sb.loss.total);
    EXPECT_EQ(sa.pair, sb.pair);
    EXPECT_EQ(sa.eigenfunctions, sb.eigenfunctions);
  }
  EXPECT_EQ(a.network().tensors(), b.network().tensors());
  options.seed = 5;
  Trainer<float> c(tiny_pairs(), options);
  EXPECT_NE(c.network().tensors(), a.network().tensors());
}

TEST_P(Training, EveryPairOnceAnEpochOnTheSchedule) {
  options.epochs = 4;
  Trainer<float> trainer(tiny_pairs(), options);
  for (int epoch = 0; epoch < 4; ++epoch) {
    std::set<int> seen;
    for (int i = 0; i < 2; ++i) {
      const TrainStep step = trainer.step();
      EXPECT_EQ(step.step, 2 * epoch + i);
      EXPECT_DOUBLE_EQ(step.learning_rate,
                       decayed_learning_rate(2e-3, 1e-4, step.step, trainer.total_steps()));
      seen.insert(step.pair);
      if (options.architecture.signal == SignalKind::spectral) {
        EXPECT_GE(step.eigenfunctions, 1);
        EXPECT_LE(step.eigenfunctions, 12);
      } else {
        EXPECT_EQ(step.eigenfunctions, 0);
      }
    }
    EXPECT_EQ(seen.size(), 2U);
  }
}

TEST_P(Training, OnMeshesWithFewerVerticesThanFunctions) {
  // The defaults, 20 to 100 eigenfunctions of the signal and 128 of the network, on 12 vertices.
  const zoo::Mesh mesh = zoo::perturbed_sphere(0, 3);
  options.fewest_eigenfunctions = 20;
  options.most_eigenfunctions = 100;
  options.architecture.eigenfunctions = 128;
  Trainer<float> trainer({{mesh.vertices, mesh.faces, test::bent(mesh.vertices)}}, options);
  for (int step = 0; step < 3; ++step) {
    const TrainStep result = trainer.step();
    EXPECT_TRUE(std::isfinite(result.loss.total));
    EXPECT_LE(result.eigenfunctions, 12);
  }
  for (const auto& [name, value] : trainer.network().tensors()) {
    EXPECT_TRUE(value.allFinite()) << name;
  }
}

TEST_P(Training, WithMoreSignalThanNetworkEigenfunctions) {
  // The signal's count is drawn above the number that the network's basis has.
  options.architecture.eigenfunctions = 8;
  options.fewest_eigenfunctions = 20;
  options.most_eigenfunctions = 40;
  Trainer<float> trainer(tiny_pairs(), options);
  EXPECT_TRUE(std::isfinite(trainer.step().loss.total));
  EXPECT_TRUE(trainer.network().tensors().at("input.mean").allFinite());
}

INSTANTIATE_TEST_SUITE_P(
    Kinds, Training,
    ::testing::Combine(::testing::Values(Configuration::paper, Configuration::equivariant),
                       ::testing::Values(SignalKind::rotation, SignalKind::spectral)),
    [](const auto& info) {
      return std::string(to_string(std::get<0>(info.param))) + "_" +
             to_string(std::get<1>(info.param));
    });

class TrainerErrors : public ::testing::Test {
 protected:
  ::testing::AssertionResult fails(ErrorCode code, std::initializer_list<const char*> parts) {
    return test::fails_with(code, parts, [this] { Trainer<float>(pairs, options); });
  }
  std::vector<TrainingPair> pairs = tiny_pairs();
  TrainOptions options = tiny_options(Configuration::equivariant, SignalKind::spectral);
};

TEST_F(TrainerErrors, NoPairs) {
  pairs.clear();
  EXPECT_TRUE(fails(ErrorCode::bad_option, {"at least one pair"}));
}

TEST_F(TrainerErrors, ATargetOfAnotherSize) {
  pairs[1].target.conservativeResize(7, 3);
  EXPECT_TRUE(fails(ErrorCode::wrong_shape, {"Pair 1", "48", "7"}));
}

TEST_F(TrainerErrors, ABadMeshNamesPairAndSide) {
  pairs[1].target(3, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(fails(ErrorCode::not_finite, {"Pair 1", "target", "Vertex 3"}));
  pairs[0].faces.resize(0, 3);
  EXPECT_TRUE(fails(ErrorCode::empty_mesh, {"Pair 0", "source"}));
}

TEST_F(TrainerErrors, TargetsWithOtherFacesWithoutArea) {
  // The same number of vertices is left on both sides, but not the same vertices.
  const zoo::Mesh two = zoo::joined(zoo::cube(), zoo::moved(zoo::cube(), {3, 0, 0}));
  Points source = two.vertices, target = two.vertices;
  for (int i = 1; i < 8; ++i) {
    source.row(i) = source.row(0);
    target.row(8 + i) = target.row(8);
  }
  pairs = {{source, two.faces, target}};
  EXPECT_TRUE(fails(ErrorCode::wrong_shape, {"Pair 0"}));
}

TEST_F(TrainerErrors, OptionsOutOfRange) {
  const TrainOptions good = options;
  const auto expect_bad = [&](const std::function<void(TrainOptions&)>& change) {
    options = good;
    change(options);
    EXPECT_TRUE(fails(ErrorCode::bad_option, {}));
  };
  expect_bad([](TrainOptions& o) { o.epochs = 0; });
  expect_bad([](TrainOptions& o) { o.samples = -1; });
  expect_bad([](TrainOptions& o) { o.fewest_eigenfunctions = 0; });
  expect_bad([](TrainOptions& o) { o.most_eigenfunctions = o.fewest_eigenfunctions - 1; });
  expect_bad([](TrainOptions& o) { o.architecture.eigenfunctions = 0; });
  expect_bad([](TrainOptions& o) { o.architecture.configuration = Configuration::paper; });
}

class SuggestionErrors : public TrainerErrors {
 protected:
  SuggestionErrors() {
    options = tiny_options(Configuration::equivariant, SignalKind::rotation);
    pairs.resize(1);
    pairs[0].suggestions = {{pairs[0].target, Eigen::Vector3i(0, 7, 9)}};
  }
  Suggestion& suggestion() { return pairs[0].suggestions[0]; }
};

TEST_F(SuggestionErrors, AnotherSize) {
  suggestion().vertices.conservativeResize(5, 3);
  EXPECT_TRUE(fails(ErrorCode::wrong_shape, {"pair 0", "5", "42"}));
}

TEST_F(SuggestionErrors, NotFinite) {
  suggestion().vertices(4, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(fails(ErrorCode::not_finite, {"pair 0"}));
}

TEST_F(SuggestionErrors, AHeldVertexOutOfRange) {
  suggestion().held[1] = 42;
  EXPECT_TRUE(fails(ErrorCode::index_out_of_range, {"pair 0", "42"}));
}

TEST_F(SuggestionErrors, AVertexHeldTwice) {
  suggestion().held[1] = 9;
  EXPECT_TRUE(fails(ErrorCode::overlapping_handles, {"9"}));
}

TEST_F(SuggestionErrors, NothingHeld) {
  suggestion().held.resize(0);
  EXPECT_TRUE(fails(ErrorCode::no_handles, {"pair 0"}));
}

TEST(TrainingFromSuggestions, DrawsThemAndReducesTheLoss) {
  TrainOptions options = tiny_options(Configuration::equivariant, SignalKind::rotation);
  options.epochs = 200;
  TrainingPair pair = tiny_pairs()[0];
  for (uint64_t i = 0; i < 3; ++i) {
    const Points guess = pair.target + 0.1 * Points(test::noise(pair.target.rows(), 3, i));
    pair.suggestions.push_back({guess, Eigen::Vector3i(0, 7, 9)});
  }
  Trainer<float> trainer({pair}, options);
  std::set<int> drawn;
  double first = 0.0, last = 0.0;
  for (int step = 0; step < 200; ++step) {
    const TrainStep result = trainer.step();
    drawn.insert(result.suggestion);
    first += step < 20 ? result.loss.total : 0.0;
    last += step >= 180 ? result.loss.total : 0.0;
  }
  EXPECT_EQ(drawn, std::set<int>({0, 1, 2}));
  EXPECT_LT(last, 0.9 * first);
}

TEST(TrainingAlongMaps, TheTrueMapIsAsNoMap) {
  TrainOptions options = tiny_options(Configuration::equivariant, SignalKind::spectral);
  TrainingPair plain = tiny_pairs()[0], mapped = plain, rough = plain;
  const auto n = static_cast<int>(plain.source.rows());
  mapped.maps = {Eigen::VectorXi::LinSpaced(n, 0, n - 1)};
  rough.maps = {Eigen::VectorXi::LinSpaced(n, 0, n - 1).reverse()};
  const double expected = Trainer<double>({plain}, options).step().loss.total;
  EXPECT_NEAR(Trainer<double>({mapped}, options).step().loss.total, expected, 1e-9 * expected);
  EXPECT_GT(Trainer<double>({rough}, options).step().loss.total, 1.1 * expected);
}

TEST(TrainingAlongMaps, RefusesAMapOfAnotherMesh) {
  const TrainOptions options = tiny_options(Configuration::equivariant, SignalKind::spectral);
  std::vector<TrainingPair> pairs = tiny_pairs();
  const Eigen::Index n = pairs[1].source.rows();
  pairs[1].maps = {Eigen::VectorXi::Zero(n - 1)};
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"pair 1"},
                               [&] { Trainer<float>(pairs, options); }));
  pairs[1].maps = {Eigen::VectorXi::Constant(n, static_cast<int>(n))};
  EXPECT_TRUE(test::fails_with(ErrorCode::index_out_of_range, {"pair 1"},
                               [&] { Trainer<float>(pairs, options); }));
}

TEST_F(TrainerErrors, Cancelled) {
  Progress progress;
  progress.cancel();
  EXPECT_TRUE(test::fails_with(ErrorCode::cancelled, {},
                               [&] { Trainer<float>(pairs, options, ProgressRange(&progress)); }));
}

}  // namespace
}  // namespace supple
