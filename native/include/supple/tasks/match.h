// SPDX-License-Identifier: GPL-3.0-or-later
// Matching two meshes with no map at all: features that are learned for the pair, a deformation
// that is learned with them, and a refined map. Source: the paper, section 4.4, and its zero-shot
// experiment (section 5.2).
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <vector>

#include "supple/core/progress.h"
#include "supple/learning/joint_trainer.h"
#include "supple/tasks/initial_map.h"
#include "supple/tasks/prepared_mesh.h"
#include "supple/tasks/refine.h"

namespace supple {

using MatchNetworks = JointNetworks<float>;

/// What training and matching need of a prepared mesh, which must outlive it.
/// functions: of functional maps and signals. Errors: those of `JointSurface`.
std::shared_ptr<const JointSurface<float>> joint_surface(const PreparedMesh& mesh,
                                                         const MatchNetworks& networks,
                                                         int functions);

/// Rough maps of two meshes both ways, found without features.
struct GuideMaps {
  std::array<Eigen::VectorXi, 2> point_maps;  ///< of the callers' vertices
  std::array<RowMatrix<double>, 2> maps;      ///< as of `Guide`
  /// Mean distance between a surface vertex and where the way there and back ends, both ways
  /// together, in roots of the area. Wrong maps are found independently and rarely agree.
  double round_trip = 0.0;
};
/// `automatic_map` both ways. functions: rows and columns wanted of the functional maps; those of
/// `joint_surface`. Errors: those of `automatic_map`.
GuideMaps guide_maps(const PreparedMesh& first, const PreparedMesh& second, int functions,
                     ProgressRange progress = {});

struct MatchOptions {
  /// Adaptation to the pair: 2 steps an epoch; 0 epochs: the features as they are. Where
  /// `automatic_map`, from either side, finds a map that bears refining better than what the
  /// features give (`RefineResult::confidence` in the mean), it is the guide of the first two
  /// thirds, whatever `guided_epochs` says.
  JointTrainOptions training;
  /// Learning rates of the features are multiplied by this where no map guides them, > 0: they know
  /// such shapes already, and larger steps on one pair take more from them than it teaches.
  double unguided_rate = 0.2;
  int functions = 80;  ///< of functional maps and the signal, >= 1
  /// Meshes of more pairs of vertices than this are not adapted to (a step would take longer than
  /// some ten seconds), and their soft map is taken between 3,000 and 6,000 samples.
  double most_pairs = 1.5e8;
  /// Also look for a map without features (`automatic_map`, from both sides). The one that bears
  /// refining better guides the adaptation; after it, all are refined and the best is returned.
  bool automatic = true;
  /// More rounds than by default: the maps found here have drifted farther.
  RefineOptions refine;

  MatchOptions() {
    refine.counts.resize(20, refine.counts.back());
    training.epochs = 15;
    training.feature_learning_rate = {1e-3, 1e-4};
  }
};

struct MatchResult {
  InitialMap initial;      ///< the map that was refined
  bool automatic = false;  ///< it came from `automatic_map`, not from the features
  RefineResult refined;
};

/// One pair. Not safe for several threads at a time.
class Matcher {
 public:
  /// Errors: `bad_option` for options out of range or a mesh that is nullptr; those of
  /// `JointSurface` and `Refiner`.
  Matcher(std::shared_ptr<const PreparedMesh> source, std::shared_ptr<const PreparedMesh> target,
          const MatchNetworks& networks, MatchOptions options = {}, ProgressRange progress = {});
  ~Matcher();

  /// Called after each epoch of adaptation; may ask for `features_map`. What it throws ends the
  /// work.
  using Watch = std::function<void(const JointEpoch&)>;
  /// Adapts the networks to the pair, if they are not yet. Goes on where a cancelled call left off.
  /// Errors: those of `JointTrainer::epoch`.
  void adapt(ProgressRange progress = {}, const Watch& watch = {});
  /// Adapts, then refines the maps of the features and the one without them with the second network
  /// (or none), and returns the most confident. Errors: those of `adapt`.
  MatchResult run(ProgressRange progress = {}, const Watch& watch = {});
  const std::vector<JointEpoch>& history() const;  ///< of adaptation so far
  const MatchNetworks& networks() const;           ///< as adapted so far

  /// What the features say now: the point map of the functional map of their soft map. The paper,
  /// Eqns 12 and 6.
  InitialMap features_map(ProgressRange progress = {}) const;
  /// Those of the refiner; "not_adapted" where the meshes are too large for it.
  const std::vector<Note>& notes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace supple
