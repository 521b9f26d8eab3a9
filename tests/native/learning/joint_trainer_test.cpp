// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/joint_trainer.h"

#include <stdexcept>

#include "native/learning/joint_surfaces.h"
#include "native/support.h"
#include "supple/spectral/functional_map.h"

namespace supple {
namespace {

class JointTraining : public ::testing::Test {
 protected:
  JointTraining() {
    options.epochs = 4;
    options.guided_epochs = 0;
    options.loss.temperature = 0.2;
    options.feature_learning_rate = {3e-3, 1e-3};
    options.jacobian_learning_rate = {1e-3, 1e-4};
  }
  // The surfaces live in meshes; the pointers share their ownership.
  std::vector<std::shared_ptr<const JointSurface<float>>> surfaces() const {
    std::vector<std::shared_ptr<const JointSurface<float>>> result;
    for (const auto& mesh : meshes) {
      result.emplace_back(mesh, &mesh->surface);
    }
    return result;
  }
  JointTrainer trainer(std::vector<int> groups = {0, 0, 0}) const {
    return {surfaces(), std::move(groups), guides, test::small_networks<float>(2), options};
  }
  // The bodies are one sphere, moved: their vertices correspond.
  GuidePair guide(int first, int second) const {
    const auto map = [&](int from, int to) {
      const auto &a = *meshes[static_cast<size_t>(from)], &b = *meshes[static_cast<size_t>(to)];
      const Eigen::Index n = a.operators.vertices.rows();
      return functional_map(a.basis, b.basis,
                            Eigen::VectorXi::LinSpaced(n, 0, static_cast<int>(n) - 1),
                            a.surface.match.values.size(), b.surface.match.values.size());
    };
    return {first, second, {map(first, second), map(second, first)}};
  }
  static double length(const JointTrainer& trainer) {
    return trainer.networks().features.parameters.last.weight.cast<double>().norm();
  }

  std::vector<std::shared_ptr<const test::PreparedSurface<float>>> meshes = {
      std::make_shared<const test::PreparedSurface<float>>(test::body(3)),
      std::make_shared<const test::PreparedSurface<float>>(test::body(4, 1.5)),
      std::make_shared<const test::PreparedSurface<float>>(test::body(5, 1.4))};
  std::vector<GuidePair> guides;
  JointTrainOptions options;
};

TEST_F(JointTraining, LowersTheLoss) {
  options.epochs = 25;
  JointTrainer training = trainer();
  while (!training.finished()) {
    training.epoch();
  }
  EXPECT_LT(training.history().back().loss.terms.total,
            0.7 * training.history().front().loss.terms.total);
  EXPECT_EQ(training.history().back().pairs, 3);
  EXPECT_TRUE(
      test::fails_with(ErrorCode::bad_option, {"finished", "25"}, [&] { training.epoch(); }));
}

TEST_F(JointTraining, GoesOnAfterAnyEpochAsIfItHadNotStopped) {
  JointTrainer whole = trainer();
  while (!whole.finished()) {
    whole.epoch();
  }
  for (int stop = 1; stop < options.epochs; ++stop) {
    JointTrainer before = trainer();
    for (int e = 0; e < stop; ++e) {
      before.epoch();
    }
    JointTrainer after = trainer();
    after.restore(before.state(), before.history());
    while (!after.finished()) {
      after.epoch();
    }
    EXPECT_EQ(after.state(), whole.state()) << "stopped after epoch " << stop;
    EXPECT_EQ(after.history().back().loss.total(), whole.history().back().loss.total());
  }
}

TEST_F(JointTraining, AnotherSeedTakesOtherPairs) {
  JointTrainer one = trainer();
  options.seed = 1;
  JointTrainer other = trainer();
  for (int e = 0; e < options.epochs; ++e) {
    one.epoch();
    other.epoch();
  }
  EXPECT_NE(one.state(), other.state());
}

TEST_F(JointTraining, AnEpochThatFailsLeavesTheTrainerAsItWas) {
  JointTrainer training = trainer();
  training.epoch();
  const auto before = training.state();
  int pairs = 0;
  EXPECT_THROW(training.epoch({},
                              [&](const JointLossValues&) {
                                if (++pairs == 2) {
                                  throw std::runtime_error("stop");
                                }
                              }),
               std::runtime_error);
  EXPECT_EQ(training.state(), before);
  Progress progress;
  progress.cancel();
  EXPECT_TRUE(test::fails_with(ErrorCode::cancelled, {},
                               [&] { training.epoch(ProgressRange(&progress)); }));
  EXPECT_EQ(training.state(), before);
  EXPECT_EQ(training.history().size(), 1u);
}

TEST_F(JointTraining, GuidesLeadAtFirst) {
  guides = {guide(0, 1)};
  options.guided_epochs = 2;
  JointTrainer training = trainer({0, 0, 0});
  EXPECT_EQ(training.epoch().guide_share, 1.0);
  // Nothing but the guide counts in the first epoch.
  EXPECT_EQ(training.history()[0].loss.total(), 0.0);
  EXPECT_GT(training.history()[0].loss.guide, 0.0);
  EXPECT_EQ(training.epoch().guide_share, 0.5);
  EXPECT_EQ(training.epoch().guide_share, 0.0);
  EXPECT_EQ(training.history()[2].loss.guide, 0.0);
}

TEST_F(JointTraining, GuidesAreLearned) {
  guides = {guide(0, 1)};
  options.epochs = options.guided_epochs = 40;
  options.loss.orthogonality = options.loss.coupling = 0.0;
  options.loss.jacobians = {0.0, 0.0, 0.0};
  JointTrainer training = trainer({0, 0, 0});
  while (!training.finished()) {
    training.epoch();
  }
  EXPECT_LT(training.history().back().loss.guide, 0.8 * training.history().front().loss.guide);
}

TEST_F(JointTraining, StopsWhereTheLossNoLongerFalls) {
  options.epochs = 50;
  options.patience = 2;
  // Steps that are far too long.
  options.feature_learning_rate = {0.5, 0.5};
  JointTrainer training = trainer();
  while (!training.finished()) {
    training.epoch();
  }
  const auto& history = training.history();
  ASSERT_LT(history.size(), 50u);
  const double best = history[history.size() - 3].loss.terms.total;
  EXPECT_GE(history[history.size() - 2].loss.terms.total, best);
  EXPECT_GE(history[history.size() - 1].loss.terms.total, best);
}

TEST_F(JointTraining, GradientsAreShortened) {
  options.largest_gradient = 1e-12;  // as good as none; Adam's step is what it is for any length
  JointTrainer none = trainer();
  const double before = length(none);
  none.epoch();
  EXPECT_NEAR(length(none), before, 1e-3 * before);
}

TEST_F(JointTraining, RefusesWhatDoesNotFit) {
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"Surface 2", "alone"}, [&] {
    trainer({0, 0, 1});
  }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"2 groups", "3 surfaces"}, [&] {
    trainer({0, 0});
  }));
  options.epochs = 0;
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"1 epoch or more"}, [&] { trainer(); }));
  options.epochs = 4;
  guides = {guide(0, 1)};
  guides[0].second = 3;
  EXPECT_TRUE(test::fails_with(ErrorCode::index_out_of_range, {"0 and 3", "there are 3"},
                               [&] { trainer(); }));
  guides = {guide(0, 0)};
  EXPECT_TRUE(
      test::fails_with(ErrorCode::bad_option, {"0 and 0", "one group"}, [&] { trainer(); }));
  guides = {};
  JointTrainer training = trainer();
  auto state = training.state();
  state.erase("features.adam.mean.0");
  EXPECT_TRUE(test::fails_with(ErrorCode::model_file, {"adam.mean.0"},
                               [&] { training.restore(state, {}); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::model_file, {"5 epochs", "4"}, [&] {
    training.restore(training.state(), std::vector<JointEpoch>(5));
  }));
}

}  // namespace
}  // namespace supple
