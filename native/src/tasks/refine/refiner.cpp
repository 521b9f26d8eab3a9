// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <chrono>
#include <string>
#include <utility>

#include "pair.h"
#include "supple/core/error.h"
#include "supple/geometry/operators.h"
#include "supple/learning/signal.h"
#include "supple/spectral/functional_map.h"
#include "supple/tasks/refine.h"

namespace supple {
namespace {

constexpr std::pair<RefineMethod, const char*> kMethods[] = {
    {RefineMethod::recovery, "recovery"},
    {RefineMethod::spectral_projection, "spectral_projection"},
};

// The norm of a face's Jacobian with both areas 1 is the root of 3 where nothing is stretched.
// Where a map is torn, the signal is far from all that networks are trained on, and their answers,
// of third degree in it, explode, a round more than the one before: no face is stretched further.
constexpr double kMostNorm = 4.0;

// Shortens the matrices that are longer; how many those were.
int bound(MatrixField& jacobians) {
  int bounded = 0;
#pragma omp parallel for schedule(static) reduction(+ : bounded)
  for (Eigen::Index f = 0; f < jacobians.rows(); ++f) {
    const double norm = jacobians.row(f).norm();
    if (norm > kMostNorm) {
      jacobians.row(f) *= kMostNorm / norm;
      ++bounded;
    }
  }
  return bounded;
}

/// Adds the milliseconds it lives to a figure.
class Stopwatch {
 public:
  explicit Stopwatch(double& sum) : sum_(sum), start_(Clock::now()) {}
  ~Stopwatch() { sum_ += std::chrono::duration<double, std::milli>(Clock::now() - start_).count(); }
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;

 private:
  using Clock = std::chrono::steady_clock;
  double& sum_;
  Clock::time_point start_;
};

// What a round's number of eigenfunctions makes of the two meshes.
struct Coarse {
  Eigen::Index count = 0;
  Points source, target;  // their vertices in so many eigenfunctions
};

// The round's state, in surface vertices and units.
struct State {
  SurfaceMap on;             // ns points on the target
  Eigen::VectorXi vertices;  // the target vertices nearest to them
  MatrixField jacobians;     // of the last signal or network
  Points moved;              // ns x 3, the recovered embedding
};

}  // namespace

const char* to_string(RefineMethod method) {
  for (const auto& [value, name] : kMethods) {
    if (value == method) {
      return name;
    }
  }
  return "";
}

RefineMethod refine_method(const std::string& name) {
  for (const auto& [value, known] : kMethods) {
    if (name == known) {
      return value;
    }
  }
  throw Error(ErrorCode::bad_option, "There is no way to refine called '" + name +
                                         "'. Use 'recovery' or 'spectral_projection'.");
}

struct Refiner::Impl {
  Impl(std::shared_ptr<const PreparedMesh> source_in, std::shared_ptr<const PreparedMesh> target_in,
       std::shared_ptr<const Network> network_in, RefineOptions options_in)
      : source(std::move(source_in)),
        target(std::move(target_in)),
        network(std::move(network_in)),
        options(std::move(options_in)),
        notes(refining::pair_notes(*source, *target, options)),
        context(network == nullptr ? nullptr : source->context_for(network->architecture())),
        source_anchor(refining::surface_anchor(source->mesh)),
        target_anchor(refining::surface_anchor(target->mesh)),
        recovery(source->operators, options.recovery,
                 options.recovery.form == RecoveryForm::product ? source->symbolic : nullptr),
        closest(target->operators.vertices, target->operators.faces) {
    const Eigen::Index most = std::min(source->basis.size(), target->basis.size());
    for (const int wanted : options.counts) {
      const Eigen::Index count =
          stable_count(source->basis, target->basis, std::min<Eigen::Index>(wanted, most));
      rounds.push_back({count, source->basis.project(source->operators.vertices, count),
                        target->basis.project(target->operators.vertices, count)});
    }
  }

  RefineResult refine(State state, const ProgressRange& progress) const;
  void spectral_round(State& state, Eigen::Index count, RefineReport& report,
                      const ProgressRange& progress) const;
  void signal_round(State& state, const Coarse& coarse, RefineReport& report) const;
  void place(State& state, RefineReport& report) const;
  RefineResult result_of(const State& state) const;

  std::shared_ptr<const PreparedMesh> source, target;
  std::shared_ptr<const Network> network;
  RefineOptions options;
  std::vector<Note> notes;
  std::shared_ptr<const NetworkContext<float>> context;
  Eigen::VectorXi source_anchor, target_anchor;
  EmbeddingRecovery recovery;
  ClosestSurfacePoints closest;
  std::vector<Coarse> rounds;
};

void Refiner::Impl::spectral_round(State& state, Eigen::Index count, RefineReport& report,
                                   const ProgressRange& progress) const {
  const Stopwatch watch(report.signal_milliseconds);
  const RowMatrix<double> map =
      functional_map(source->basis, target->basis, state.vertices, count, count);
  const SurfaceOperators& surface = target->operators;
  state.vertices = point_map(source->basis, target->basis, map, progress);
  state.on = surface_map(state.vertices, surface.faces, surface.vertices.rows());
  state.moved = surface.vertices(state.vertices, Eigen::all);
}

void Refiner::Impl::signal_round(State& state, const Coarse& coarse, RefineReport& report) const {
  Signal signal;
  {
    const Stopwatch watch(report.signal_milliseconds);
    const Points pulled = apply(state.on, target->operators.faces, coarse.target);
    signal = spectral_signal(source->operators, coarse.source,
                             Points(source->basis.project(pulled, coarse.count)));
  }
  const Stopwatch watch(report.network_milliseconds);
  if (network == nullptr) {
    state.jacobians = std::move(signal.fields.front());
    return;
  }
  state.jacobians = network->forward(*context, signal);
  report.bounded_faces = bound(state.jacobians);
}

// Recovers the embedding near the present points, and takes the target's nearest to it.
void Refiner::Impl::place(State& state, RefineReport& report) const {
  const SurfaceOperators& surface = target->operators;
  {
    const Stopwatch watch(report.recovery_milliseconds);
    state.moved = recovery.solve(apply(state.on, surface.faces, surface.vertices), state.jacobians);
  }
  const Stopwatch watch(report.nearest_milliseconds);
  const Points normals = vertex_normals(state.moved, source->operators.faces);
  state.on =
      closest.query(state.moved, normals, options.facing, options.facing_reach, state.on.face).map;
  state.vertices = nearest_corners(state.on, surface.faces);
}

RefineResult Refiner::Impl::refine(State state, const ProgressRange& progress) const {
  RefineReport report;
  {
    const Stopwatch watch(report.total_milliseconds);
    const bool spectral = options.method == RefineMethod::spectral_projection;
    const int settling = spectral ? 0 : options.settling_rounds;
    report.network = network != nullptr && !spectral;
    report.rounds = static_cast<int>(options.counts.size()) + settling;
    for (int round = 0; round < report.rounds; ++round) {
      const ProgressRange part = progress.stage(
          "round " + std::to_string(round + 1) + " of " + std::to_string(report.rounds),
          static_cast<double>(round) / report.rounds,
          static_cast<double>(round + 1) / report.rounds);
      part.report(0.0);
      if (static_cast<size_t>(round) < rounds.size()) {
        const Coarse& coarse = rounds[static_cast<size_t>(round)];
        report.eigenfunctions = static_cast<int>(coarse.count);
        if (spectral) {
          spectral_round(state, coarse.count, report, part);
          continue;
        }
        signal_round(state, coarse, report);
      }
      part.report(0.7);
      place(state, report);
    }
  }
  progress.report(1.0);
  RefineResult result = result_of(state);
  result.report = report;
  return result;
}

RefineResult Refiner::Impl::result_of(const State& state) const {
  const TriangleMesh& from = source->mesh;
  const TriangleMesh& to = target->mesh;
  RefineResult result;
  result.point_map = refining::from_surfaces(to, source_anchor, state.vertices);
  result.surface_map = refining::from_surfaces(to, source_anchor, state.on);
  // `scatter` ends in the source's units.
  const Points laid = from.scatter(
      state.moved, source->operators.average * source->operators.jacobians_of(state.moved));
  result.recovered = to.from_surface(from.to_surface(laid));
  const Eigen::VectorXd sure = refining::confidence(source->operators, target->operators,
                                                    state.moved, state.on, state.vertices);
  result.confidence = sure(source_anchor);
  if (options.backward) {
    const SurfaceOperators& surface = target->operators;
    const ClosestSurfacePoints laid_out(state.moved, source->operators.faces);
    const SurfaceMap back =
        laid_out
            .query(surface.vertices, surface.vertex_normals, options.facing, options.facing_reach)
            .map;
    result.backward_surface_map = refining::from_surfaces(from, target_anchor, back);
    result.backward_point_map = refining::from_surfaces(
        from, target_anchor, nearest_corners(back, source->operators.faces));
  }
  return result;
}

Refiner::Refiner(std::shared_ptr<const PreparedMesh> source,
                 std::shared_ptr<const PreparedMesh> target, std::shared_ptr<const Network> network,
                 RefineOptions options, ProgressRange progress) {
  refining::check_options(options);
  if (source == nullptr || target == nullptr) {
    throw Error(ErrorCode::bad_option, "Refining needs a source and a target.");
  }
  if (network != nullptr && network->architecture().signal != SignalKind::spectral) {
    throw Error(ErrorCode::bad_option,
                "This network takes rotations. Refining a map needs one trained on the spectral "
                "signal.");
  }
  progress.report(0.0);
  impl_ = std::make_unique<const Impl>(std::move(source), std::move(target), std::move(network),
                                       std::move(options));
  progress.report(1.0);
}

Refiner::~Refiner() = default;

const RefineOptions& Refiner::options() const { return impl_->options; }
const std::vector<Note>& Refiner::notes() const { return impl_->notes; }

RefineResult Refiner::refine(const Eigen::VectorXi& point_map, ProgressRange progress) const {
  const SurfaceOperators& surface = impl_->target->operators;
  State state;
  state.vertices = refining::to_surfaces(impl_->source->mesh, impl_->target->mesh,
                                         impl_->target_anchor, point_map);
  state.on = surface_map(state.vertices, surface.faces, surface.vertices.rows());
  return impl_->refine(std::move(state), progress);
}

RefineResult Refiner::refine(const SurfaceMap& map, ProgressRange progress) const {
  State state;
  state.on = refining::to_surfaces(impl_->source->mesh, impl_->target->mesh, map);
  state.vertices = nearest_corners(state.on, impl_->target->operators.faces);
  return impl_->refine(std::move(state), progress);
}

}  // namespace supple
