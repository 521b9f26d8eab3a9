// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <optional>
#include <string>
#include <utility>

#include "supple/core/dense.h"
#include "supple/core/error.h"
#include "supple/learning/soft_map.h"
#include "supple/spectral/functional_map.h"
#include "supple/spectral/map_fit.h"
#include "supple/spectral/sampling.h"
#include "supple/tasks/match.h"
#include "tasks/initial_map/candidates.h"
#include "tasks/refine/pair.h"

namespace supple {
namespace {

constexpr Eigen::Index kFew = 20, kStep = 4;  // functions that ZoomOut starts from, and its steps
constexpr int kFineStep = 10;                 // and its steps from the nearest features on
constexpr Eigen::Index kSourceSamples = 3000, kTargetSamples = 6000;

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

// k1 x k2, of a map of the callers' vertices.
RowMatrix<double> functional_map_of(const PreparedMesh& source, const PreparedMesh& target,
                                    const Eigen::VectorXi& point_map, Eigen::Index k1,
                                    Eigen::Index k2) {
  const Eigen::VectorXi on_surfaces = refining::to_surfaces(
      source.mesh, target.mesh, refining::surface_anchor(target.mesh), point_map);
  return functional_map(source.basis, target.basis, on_surfaces, k1, k2);
}

// How well a map bears refining: a wrong one leaves the laid surface off the target, turned away
// from it, or led elsewhere on the way back. Of 36 maps between creatures, the most confident of
// three was 7% nearer to the truth than the one of the best score, which settles what is alike.
double standing(const InitialMap& initial, const RefineResult& refined) {
  constexpr double kScore = 0.05;
  return refined.confidence.mean() + kScore * initial.score.value();
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
        refiner(source, target, nullptr, options.refine, progress),
        notes(refiner.notes()) {
    if (options.training.epochs < 0) {
      throw Error(ErrorCode::bad_option, "A match takes 0 epochs of adaptation or more.");
    }
    const Eigen::Index n1 = source->basis.mass.size(), n2 = target->basis.mass.size();
    large = static_cast<double>(n1) * static_cast<double>(n2) > options.most_pairs;
    if (large && options.training.epochs > 0) {
      notes.push_back({"not_adapted", static_cast<int>(std::max(n1, n2)),
                       "The meshes have " + std::to_string(n1) + " and " + std::to_string(n2) +
                           " vertices, too many to adapt the features to them; they are used as "
                           "they are. Coarser copies of the meshes can be adapted to."});
    }
    if (adapts()) {  // to say what is wrong before the long work
      start({});
    }
  }

  bool adapts() const { return !large && options.training.epochs > 0; }
  void start(std::vector<GuidePair> guides) {
    JointTrainOptions training = options.training;
    training.guided_epochs = (2 * training.epochs + 2) / 3;
    for (double& rate : training.feature_learning_rate) {
      rate *= guides.empty() ? options.unguided_rate : 1.0;
    }
    trainer.emplace(std::vector{surfaces[0], surfaces[1]}, std::vector{0, 0}, std::move(guides),
                    networks, training);
  }
  // Without a network.
  double standing_of(const InitialMap& map, const ProgressRange& progress) const {
    return standing(map, refiner.refine(map.point_map, progress));
  }
  // The map without features, found once: that of the direction, as they look in different places,
  // which bears refining better.
  const InitialMap& without_features(const ProgressRange& progress);
  // That map both ways, as the trainer wants it.
  GuidePair guide() const;

  FeaturePair<float> features() const;  // of both surfaces, as adapted so far
  // C' of the features, source to target; of large meshes from samples.
  RowMatrix<double> functional_map(const FeaturePair<float>& features,
                                   const ProgressRange& progress) const;
  // What the features say: the vertices with the nearest features, which tell apart more than a
  // functional map can hold, made smooth by ZoomOut. Of large meshes the point map of `map`, C'.
  InitialMap of_features(const initial_maps::MeshPair& pair, const FeaturePair<float>& features,
                         const RowMatrix<double>& map, const ProgressRange& progress) const;
  // From its first few functions on by ZoomOut: features that lead roughly to the right place are
  // enough.
  static InitialMap upsampled(const initial_maps::MeshPair& pair, const RowMatrix<double>& map,
                              const ProgressRange& progress);
  const MatchNetworks& now() const { return trainer.has_value() ? trainer->networks() : networks; }

  MatchOptions options;
  std::shared_ptr<const PreparedMesh> source, target;
  std::array<std::shared_ptr<const JointSurface<float>>, 2> surfaces;
  MatchNetworks networks;  // as given
  std::optional<JointTrainer> trainer;
  // Without a network: for its notes and checks before the long work, and to compare first maps. In
  // the end refining takes the adapted network.
  Refiner refiner;
  std::vector<Note> notes;
  std::optional<InitialMap> automatic;
  double automatic_standing = 0.0;
  bool large = false;  // too large for a soft map of every vertex
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

FeaturePair<float> Matcher::Impl::features() const {
  FeaturePair<float> features;
  for (size_t d = 0; d < 2; ++d) {
    features[d] = now().features.features(surfaces[d]->features);
  }
  return features;
}

RowMatrix<double> Matcher::Impl::functional_map(const FeaturePair<float>& features,
                                                const ProgressRange& progress) const {
  const MatchSurface &from = surfaces[0]->match, &to = surfaces[1]->match;
  if (!large) {
    return match<float>({&from, &to}, features, options.training.loss, progress)[0].soft_map;
  }
  const Points& points = source->operators.vertices;
  const Eigen::VectorXi rows = farthest_point_samples(points, kSourceSamples);
  const Eigen::VectorXi columns =
      farthest_point_samples(target->operators.vertices, kTargetSamples);
  const SoftMapPair<float> soft(features[0](rows, Eigen::all), features[1](columns, Eigen::all),
                                options.training.loss.temperature,
                                progress.stage("soft map", 0.0, 0.3));
  const RowMatrix<float> functions = to.functions(columns, Eigen::all).cast<float>();
  const RowMatrix<double> pulled =
      soft.apply({RowMatrix<float>(), functions}, progress.stage("soft map", 0.3, 1.0))[0]
          .values.cast<double>();
  return product(sampled_domain<double>(source->basis, from.values.size(), points, rows).projector,
                 pulled);
}

InitialMap Matcher::Impl::of_features(const initial_maps::MeshPair& pair,
                                      const FeaturePair<float>& features,
                                      const RowMatrix<double>& map,
                                      const ProgressRange& progress) const {
  if (large) {
    return pair.finished(map, progress);
  }
  const SoftMapPair<float> soft(features[0], features[1], options.training.loss.temperature);
  ZoomoutOptions rounds;
  rounds.to = static_cast<int>(
      std::min({Eigen::Index(rounds.to), source->basis.size(), target->basis.size()}));
  rounds.from = static_cast<int>(std::min({map.rows(), map.cols(), Eigen::Index(rounds.to)}));
  rounds.step = kFineStep;
  const Zoomout found = zoomout(source->basis, target->basis,
                                soft.hard_map(0, progress.stage("comparing features", 0.0, 0.3)),
                                rounds, progress.stage("upsampling", 0.3, 1.0));
  return pair.finished(found.point_map);
}

InitialMap Matcher::Impl::upsampled(const initial_maps::MeshPair& pair,
                                    const RowMatrix<double>& map, const ProgressRange& progress) {
  const Eigen::Index few = std::min({kFew, map.rows(), map.cols(), pair.count});
  return pair.finished(
      sampled_zoomout(pair.source_functions, pair.target_functions, map.topLeftCorner(few, few),
                      pair.count, kStep, {}, progress.stage("upsampling", 0.0, 0.5)),
      progress.stage("finding vertices", 0.5, 1.0));
}

InitialMap Matcher::features_map(ProgressRange progress) const {
  const RowMatrix<double> map =
      impl_->functional_map(impl_->features(), progress.stage("comparing features", 0.0, 0.8));
  return initial_maps::MeshPair(*impl_->source, *impl_->target)
      .finished(map, progress.stage("finding vertices", 0.8, 1.0));
}

const InitialMap& Matcher::Impl::without_features(const ProgressRange& progress) {
  if (!automatic.has_value()) {
    InitialMap found =
        automatic_map(*source, *target, progress.stage("looking for a first map", 0.0, 0.45));
    const InitialMap back = automatic_map(
        *target, *source, progress.stage("looking for one from the other side", 0.45, 0.9));
    const initial_maps::MeshPair pair(*source, *target);
    // Maps of equal areas are orthogonal, so the way there is the transpose.
    InitialMap turned = upsampled(
        pair,
        functional_map_of(*target, *source, back.point_map, pair.count, pair.count).transpose(),
        progress.stage("upsampling", 0.9, 0.92));
    for (const Note& note : back.notes) {
      if (note.code == "uncertain") {  // the shapes are symmetric, whichever side one looks from
        turned.notes.push_back(note);
      }
    }
    automatic_standing = standing_of(found, progress.stage("refining", 0.92, 0.96));
    const double other = standing_of(turned, progress.stage("refining", 0.96, 1.0));
    if (other > automatic_standing) {
      found = std::move(turned);
      automatic_standing = other;
    }
    automatic = std::move(found);
  }
  return *automatic;
}

GuidePair Matcher::Impl::guide() const {
  const Eigen::Index k1 = surfaces[0]->match.values.size(), k2 = surfaces[1]->match.values.size();
  const RowMatrix<double> map = functional_map_of(*source, *target, automatic->point_map, k1, k2);
  // Maps of equal areas are orthogonal, so the way back is the transpose.
  return {0, 1, {map, RowMatrix<double>(map.transpose())}};
}

void Matcher::adapt(ProgressRange progress, const Watch& watch) {
  if (impl_->adapts() && impl_->options.automatic && history().empty()) {
    const ProgressRange looking = progress.stage("looking for a first map", 0.0, 0.1);
    const InitialMap features = features_map(looking.stage("comparing features", 0.0, 0.3));
    const double known = impl_->standing_of(features, looking.stage("refining", 0.3, 0.4));
    impl_->without_features(looking.stage("looking for a first map", 0.4, 1.0));
    if (impl_->automatic_standing > known) {
      impl_->start({impl_->guide()});
    }
    progress = progress.stage("adapting to the pair", 0.1, 1.0);
  }
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
  const FeaturePair<float> features = impl_->features();
  const RowMatrix<double> map =
      impl_->functional_map(features, progress.stage("comparing features", 0.8, 0.84));
  const initial_maps::MeshPair pair(*impl_->source, *impl_->target);
  const Refiner refiner(impl_->source, impl_->target, refining_network(impl_->now()),
                        impl_->options.refine);
  MatchResult result;
  const auto consider = [&](InitialMap initial, bool automatic, double from) {
    RefineResult refined =
        refiner.refine(initial.point_map, progress.stage("refining", from, from + 0.02));
    if (result.refined.point_map.size() == 0 ||
        standing(initial, refined) > standing(result.initial, result.refined)) {
      result = {std::move(initial), automatic, std::move(refined)};
    }
  };
  consider(impl_->of_features(pair, features, map, progress.stage("finding vertices", 0.84, 0.86)),
           false, 0.86);
  consider(Impl::upsampled(pair, map, progress.stage("upsampling", 0.88, 0.89)), false, 0.89);
  if (impl_->options.automatic) {
    consider(impl_->without_features(progress.stage("looking for other maps", 0.91, 0.98)), true,
             0.98);
  }
  return result;
}

const std::vector<Note>& Matcher::notes() const { return impl_->notes; }

}  // namespace supple
