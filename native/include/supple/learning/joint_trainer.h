// SPDX-License-Identifier: GPL-3.0-or-later
// Training features and a local Jacobian network together, on surfaces without a known map.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "supple/core/progress.h"
#include "supple/learning/adam.h"
#include "supple/learning/joint_loss.h"

namespace supple {

/// A rough map between two of the surfaces, to start from; no label: `automatic_map` finds such.
struct GuidePair {
  int first = 0, second = 0;              ///< surfaces
  std::array<RowMatrix<double>, 2> maps;  ///< as of `Guide`, first to second and back
};

struct JointTrainOptions {
  UnsupervisedOptions loss;  ///< the paper's weights
  int epochs = 20;           ///< >= 1
  /// If above 0, the temperature of the first epoch; its inverse goes by equal steps to that of
  /// `loss.temperature` in the last. 0: the same throughout.
  double first_temperature = 0.0;
  /// Epochs at the start that take their pairs from the guides; without guides there are none.
  /// Their share s of the loss falls by equal steps from 1 in the first of these epochs to 0 after
  /// the last: s guide_weight |C' - guide|^2 + (1 - s) loss.
  int guided_epochs = 5;
  double guide_weight = 1.0;
  /// First and last of each network; between them the same factor every step.
  std::array<double, 2> feature_learning_rate = {1e-3, 1e-4};
  std::array<double, 2> jacobian_learning_rate = {1e-4, 1e-5};
  /// Each network's gradient is shortened to this length where it is longer; 0: never. Where a soft
  /// map shrinks a face to a point its derivative has no bound.
  double largest_gradient = 1.0;
  /// Training ends early after so many epochs, not counting guided ones, without a smaller mean
  /// loss; 0: never.
  int patience = 0;
  uint64_t seed = 0;  ///< of the pairs of every epoch
};

/// Means over an epoch's pairs.
struct JointEpoch {
  int epoch = 0;  ///< from 0
  int pairs = 0;
  JointLossValues loss;
  double guide_share = 0.0;
};

/// One pair a step, Adam for each network. An epoch takes every surface once, with another of its
/// group, both drawn from the seed and the epoch's number alone; guided epochs draw as many of the
/// guides. So training goes on after any epoch from `state` as if it had not stopped, and the same
/// seed and threads give the same bytes.
class JointTrainer {
 public:
  using Networks = JointNetworks<float>;
  using Surface = JointSurface<float>;

  /// groups: one number a surface; pairs are of one group. Surfaces are shared, never changed.
  /// Errors: `bad_option` for options out of range, a surface without another in its group, or a
  /// guide between groups; `wrong_shape`, `index_out_of_range` for a guide.
  JointTrainer(std::vector<std::shared_ptr<const Surface>> surfaces, std::vector<int> groups,
               std::vector<GuidePair> guides, Networks networks, JointTrainOptions options);

  const JointTrainOptions& options() const { return options_; }
  const Networks& networks() const { return networks_; }
  /// Of every epoch so far.
  const std::vector<JointEpoch>& history() const { return history_; }
  /// After all epochs, or early.
  bool finished() const;
  int pairs_per_epoch() const { return static_cast<int>(surfaces_.size()); }

  /// Called after each pair with its losses; what it throws ends the epoch.
  using Watch = std::function<void(const JointLossValues&)>;
  /// Trains the next epoch. A cancelled or failed one leaves the trainer as it was before it.
  /// Errors: those of `joint_loss`; `bad_option` when finished; `not_finite` for a loss that is.
  const JointEpoch& epoch(ProgressRange progress = {}, const Watch& watch = {});

  /// Weights and all that Adam remembers, by name.
  std::map<std::string, RowMatrix<float>> state() const;
  /// Goes on from a state and its history. Errors: `model_file` where they don't fit.
  void restore(const std::map<std::string, RowMatrix<float>>& state,
               std::vector<JointEpoch> history);

 private:
  struct Step {
    int first, second;
    const GuidePair* guide;
  };
  std::vector<Step> steps_of(int epoch) const;
  double guide_share(int epoch) const;
  UnsupervisedOptions loss_of(int epoch) const;
  void update(const JointGradient<float>& gradient, const UnsupervisedOptions& loss, int step);

  std::vector<std::shared_ptr<const Surface>> surfaces_;
  std::vector<std::vector<int>> partners_;  // of each surface, those of its group
  std::vector<GuidePair> guides_;
  Networks networks_;
  JointTrainOptions options_;
  DiffusionAdam<float> feature_adam_;
  std::optional<Adam<float>> jacobian_adam_;
  std::vector<JointEpoch> history_;
};

}  // namespace supple
