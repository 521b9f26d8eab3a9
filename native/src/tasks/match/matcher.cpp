// SPDX-License-Identifier: GPL-3.0-or-later
#include <optional>
#include <utility>

#include "supple/core/error.h"
#include "supple/tasks/match.h"
#include "tasks/initial_map/candidates.h"

namespace supple {
namespace {

const PreparedMesh& checked(const std::shared_ptr<const PreparedMesh>& mesh, const char* which) {
  if (mesh == nullptr) {
    throw Error(ErrorCode::bad_option,
                std::string("The ") + which + " mesh of a match is missing.");
  }
  return *mesh;
}

std::shared_ptr<const LocalJacobianNetwork<float>> refining_network(const MatchNetworks& networks) {
  return networks.jacobians.has_value()
             ? std::make_shared<const LocalJacobianNetwork<float>>(*networks.jacobians)
             : nullptr;
}

}  // namespace

struct Matcher::Impl {
  Impl(std::shared_ptr<const PreparedMesh> source_in, std::shared_ptr<const PreparedMesh> target_in,
       const MatchNetworks& networks_in, MatchOptions options_in, const ProgressRange& progress)
      : options(std::move(options_in)),
        source(std::move(source_in)),
        target(std::move(target_in)),
        surfaces{joint_surface(checked(source, "source"), networks_in, options.functions),
                 joint_surface(checked(target, "target"), networks_in, options.functions)},
        networks(networks_in),
        refiner(source, target, nullptr, options.refine, progress) {
    if (options.training.epochs < 0) {
      throw Error(ErrorCode::bad_option, "A match takes 0 epochs of adaptation or more.");
    }
    if (options.training.epochs > 0) {
      trainer.emplace(std::vector{surfaces[0], surfaces[1]}, std::vector{0, 0},
                      std::vector<GuidePair>{}, networks_in, options.training);
    }
  }

  const MatchNetworks& now() const { return trainer.has_value() ? trainer->networks() : networks; }

  MatchOptions options;
  std::shared_ptr<const PreparedMesh> source, target;
  std::array<std::shared_ptr<const JointSurface<float>>, 2> surfaces;
  MatchNetworks networks;  // as given
  std::optional<JointTrainer> trainer;
  Refiner refiner;  // for its notes and checks before the long work; refining takes the adapted one
};

Matcher::Matcher(std::shared_ptr<const PreparedMesh> source,
                 std::shared_ptr<const PreparedMesh> target, const MatchNetworks& networks,
                 MatchOptions options, ProgressRange progress)
    : impl_(std::make_unique<Impl>(std::move(source), std::move(target), networks,
                                   std::move(options), progress)) {}

Matcher::~Matcher() = default;

const std::vector<JointEpoch>& Matcher::history() const {
  static const std::vector<JointEpoch> none;
  return impl_->trainer.has_value() ? impl_->trainer->history() : none;
}

const MatchNetworks& Matcher::networks() const { return impl_->now(); }

InitialMap Matcher::features_map(ProgressRange progress) const {
  FeaturePair features;
  for (size_t d = 0; d < 2; ++d) {
    features[d] = impl_->now().features.features(impl_->surfaces[d]->features).cast<double>();
  }
  const Match found =
      match({&impl_->surfaces[0]->match, &impl_->surfaces[1]->match}, features,
            impl_->options.training.loss, progress.stage("comparing features", 0.0, 0.8));
  return initial_maps::MeshPair(*impl_->source, *impl_->target)
      .finished(found[0].soft_map, progress.stage("finding vertices", 0.8, 1.0));
}

void Matcher::adapt(ProgressRange progress, const Watch& watch) {
  const double epochs = impl_->options.training.epochs;
  while (impl_->trainer.has_value() && !impl_->trainer->finished()) {
    const auto done = static_cast<double>(history().size());
    const JointEpoch& epoch = impl_->trainer->epoch(
        progress.stage("adapting to the pair", done / epochs, (done + 1.0) / epochs));
    if (watch) {
      watch(epoch);
    }
  }
}

MatchResult Matcher::run(ProgressRange progress, const Watch& watch) {
  adapt(progress.stage("adapting to the pair", 0.0, 0.8), watch);
  MatchResult result;
  result.initial = features_map(progress.stage("comparing features", 0.8, 0.85));
  if (impl_->options.automatic) {
    InitialMap other = automatic_map(*impl_->source, *impl_->target,
                                     progress.stage("looking for other maps", 0.85, 0.95));
    if (other.score.value() > result.initial.score.value()) {
      result.initial = std::move(other);
      result.automatic = true;
    }
  }
  const Refiner refiner(impl_->source, impl_->target, refining_network(impl_->now()),
                        impl_->options.refine);
  result.refined = refiner.refine(result.initial.point_map, progress.stage("refining", 0.95, 1.0));
  return result;
}

const std::vector<Note>& Matcher::notes() const { return impl_->refiner.notes(); }

}  // namespace supple
