// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <memory>
#include <random>
#include <vector>

#include "supple/core/progress.h"
#include "supple/learning/adam.h"
#include "supple/learning/losses.h"
#include "supple/learning/network.h"

namespace supple {

/// What an edit starts from: some vertices at their targets, the others guessed.
struct Suggestion {
  Points vertices;       ///< n x 3
  Eigen::VectorXi held;  ///< 0-based vertices that are at their targets; at least one a component
};

/// One supervised example: two embeddings of one connectivity, in any units.
struct TrainingPair {
  Points source;  ///< n x 3
  Faces faces;    ///< m x 3
  Points target;  ///< n x 3
  /// For the rotation signal: what it is taken from, one drawn each step, and then the losses hold
  /// its vertices. Without any, the signal is taken from the target itself, as in the paper.
  std::vector<Suggestion> suggestions = {};
  /// For the spectral signal: rough maps, one target vertex for each of the n source vertices. One
  /// is drawn each step and the target pulled back along it, as refining does; what is asked for
  /// stays the true target. Without any, along the true map, as in the paper.
  std::vector<Eigen::VectorXi> maps = {};
};

struct TrainOptions {
  Architecture architecture;
  int epochs = 50;                    ///< the paper
  double first_learning_rate = 1e-3;  ///< the paper
  double last_learning_rate = 1e-5;   ///< the paper
  LossWeights weights;                ///< the paper
  /// Points of each mesh the layers are evaluated at; 0 for every vertex (`paper`).
  int samples = 1024;
  /// Augmentation of the spectral signal: each step draws its number of eigenfunctions from here.
  int fewest_eigenfunctions = 20;
  int most_eigenfunctions = 100;
  uint64_t seed = 0;
};

/// What one step did.
struct TrainStep {
  int step = 0;
  int pair = 0;
  int eigenfunctions = 0;  ///< of the spectral signal; 0 for rotations
  int suggestion = -1;     ///< which of the pair's suggestions or maps; -1 for the target itself
  double learning_rate = 0.0;
  LossValues loss;
};

/// Supervised training of a Local Jacobian Network: one pair a step, every pair once an epoch in a
/// new random order, Adam. Same seed and threads: same bytes. Source: the paper, sections 4.2
/// and 4.6.
template <class Scalar>
class Trainer {
 public:
  /// Prepares every pair (operators, eigenbases, Poisson factors).
  /// Errors: those of `TriangleMesh`, `wrong_shape` (target's rows), `bad_option`, `cancelled`.
  Trainer(const std::vector<TrainingPair>& pairs, const TrainOptions& options,
          ProgressRange progress = {});
  ~Trainer();

  int total_steps() const;
  /// The next step of the schedule.
  TrainStep step();
  LocalJacobianNetwork<Scalar>& network() { return network_; }

 private:
  struct Example;
  Signal signal_of(const Example& example, int eigenfunctions, int suggestion) const;
  void normalise_inputs();

  TrainOptions options_;
  std::vector<std::unique_ptr<Example>> examples_;
  LocalJacobianNetwork<Scalar> network_;
  Adam<Scalar> adam_;
  std::mt19937_64 generator_;
  std::vector<int> order_;
  int next_ = 0;
};

}  // namespace supple
