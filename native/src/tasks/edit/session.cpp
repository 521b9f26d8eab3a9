// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/LU>
#include <chrono>
#include <cmath>

#include "descent.h"
#include "handle_checks.h"
#include "rounds.h"
#include "soft_handles.h"
#include "suggestion.h"
#include "supple/core/error.h"
#include "supple/geometry/jacobians.h"
#include "supple/tasks/edit.h"
#include "volume.h"

namespace supple {
namespace {

// Passes between two looks for folds; and once all passes are made, while any are left: then so
// many more, as a part of all, at most.
constexpr int kFoldInterval = 8, kLateFoldInterval = 4;
constexpr double kMostLatePasses = 0.75;

// The network's stretch S goes no farther from the identity than this, |S - I|. Beyond are faces
// that collapse: in its training, the inner sides of joints, where true poses cut into themselves.
constexpr double kMostStretch = 0.4;

class Stopwatch {
 public:
  double milliseconds() const {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start_)
        .count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

void check_options(const EditOptions& options) {
  if (options.rounds < 0 || options.passes < 0 || options.network_rounds < 0 ||
      options.polish < 0) {
    throw Error(ErrorCode::bad_option, "Rounds, polish and passes must be 0 or more.");
  }
  if (!(options.stiffness >= 0.0 && options.stiffness <= 1.0)) {
    throw Error(ErrorCode::bad_option, "The stiffness is " + std::to_string(options.stiffness) +
                                           "; it must be from 0 (natural) to 1 (stiff).");
  }
}

// Whether a handle's matrix leaves lengths as they are.
bool rigid(const Eigen::Matrix4d& matrix) {
  const Matrix3 linear = matrix.topLeftCorner<3, 3>();
  return (linear - closest_rotation(linear)).norm() < 1e-3;
}

// Of the pose that an edit starts from, what energies ask: a face without an area there has no
// strain, and weighs nothing.
std::unique_ptr<const SurfaceOperators> operators_of(const SurfaceOperators& rest,
                                                     const StartPose& start) {
  auto result = std::make_unique<SurfaceOperators>(rest);
  result->vertices = start.vertices;
  result->face_normals = start.face_normals;
  for (Eigen::Index f = 0; f < rest.faces.rows(); ++f) {
    if (is_degenerate(start.vertices, rest.faces, f)) {
      result->face_areas[f] = 0.0;
      result->inverse_frames.row(f).setZero();
    } else {
      result->face_areas[f] *= matrix_at(start.jacobians, f).determinant();
      matrix_at(result->inverse_frames, f) =
          matrix_at(start.jacobians, f).inverse() * matrix_at(rest.inverse_frames, f);
    }
  }
  return result;
}

Matrix3 row_rotation(const Eigen::Matrix4d& matrix) {
  return closest_rotation(Matrix3(matrix.topLeftCorner<3, 3>().transpose()));
}

}  // namespace

struct EditSession::State {
  State(std::shared_ptr<const Editor> editor_in, const EditOptions& options_in)
      : editor(std::move(editor_in)), options(options_in) {
    check_options(options);
    const bool supple = options.method == EditMethod::supple;
    with_network = supple && options.network && editor->network_ != nullptr && options.rounds > 0 &&
                   options.network_rounds > 0;
    polish = supple ? options.polish : 0;
    passes =
        supple
            ? static_cast<int>(std::lround(options.stiffness * options.stiffness * options.passes))
            : options.passes;
  }

  const SurfaceOperators& operators() const { return editor->prepared_->operators; }
  /// Steps until there is a pose to show; passes follow.
  int usable() const { return 1 + options.rounds + polish + (report.volume_kept ? 1 : 0); }
  int step_count() const { return usable() + passes; }
  bool settled() const { return next >= step_count(); }
  /// Where the edit starts from, in surface units and in the caller's.
  const Points& from() const { return start == nullptr ? operators().vertices : start->vertices; }
  const Points& mesh_from() const {
    return start == nullptr ? editor->prepared_->mesh.vertices() : start->mesh_vertices;
  }
  void aim(const std::vector<HandleTarget>& targets, std::shared_ptr<const StartPose> start_in);
  void step();
  EditResult result() const;

  void find_guide_rotations(const Points& handles_before,
                            const std::vector<std::optional<Matrix3>>& known);
  Points smooth_displacement() const;
  void suggest();
  /// Adds what the residual of the Poisson equation and the soft handles' pulls leave to be done.
  void correct(Points residual);
  const BlockField* from_start() const { return start == nullptr ? nullptr : &start_stretch; }
  /// m x 9: what `points` make of the faces since the start: closest rotations.
  MatrixField rotations_since_start(const Points& points) const {
    return rotations_of(*editor->faces_, points, from_start());
  }
  /// Whether the step after this one restores volume; never of the first, which starts undeformed.
  bool restores_next() const { return report.volume_kept && next > 0 && next + 2 == usable(); }
  void round(bool use_network);
  void polish_pass();
  void restore_volume();
  void pass();
  void find_kept_volumes(const std::vector<HandleTarget>& targets);

  std::shared_ptr<const Editor> editor;
  EditOptions options;
  bool with_network = false, aimed = false;
  int polish = 0, passes = 0;

  std::shared_ptr<const StartPose> start;            // nullptr: the rest shape
  SurfaceLook<float> look;                           // of `start`, for the network
  std::unique_ptr<const SurfaceOperators> of_start;  // for energies

  Points positions;     // of every handle vertex in handle order, caller's units
  Points held;          // of editor->held_, surface units
  Points soft_targets;  // those of them that are soft
  RigidMotion whole;
  std::vector<Matrix3> guide_rotations;
  Points moved;
  BlockField start_stretch;      // the start's Jacobians; empty at rest
  BlockField stretch;            // of the last round with the network, times the start's Jacobians
  Points way;                    // along which lost volume is restored; empty before it is known
  Eigen::VectorXd kept_volumes;  // a component: its volume before the edit, 0 where it is not kept
  std::unique_ptr<DeformationEnergy> energy;
  std::unique_ptr<PulledEnergy> pulled;  // with the soft handles
  std::unique_ptr<Descent> descent;
  int next = 0;  // step
  EditReport report;

 private:
  Points target_positions(const std::vector<HandleTarget>& targets) const;
  void place_loose_pieces(Points& placed, const MatrixField& vertex_jacobians) const;
};

Points EditSession::State::target_positions(const std::vector<HandleTarget>& targets) const {
  const Points& before = mesh_from();
  Points result(editor->held_slot_.size(), 3);
  Eigen::Index row = 0;
  for (size_t h = 0; h < targets.size(); ++h) {
    const Eigen::VectorXi& vertices = editor->handles_[h].vertices;
    for (Eigen::Index i = 0; i < vertices.size(); ++i, ++row) {
      const Eigen::RowVector3d point = before.row(vertices[i]);
      if (targets[h].matrix) {
        result.row(row) = (targets[h].matrix->topLeftCorner<3, 3>() * point.transpose() +
                           targets[h].matrix->topRightCorner<3, 1>())
                              .transpose();
      } else if (targets[h].positions) {
        result.row(row) = targets[h].positions->row(i);
      } else {
        result.row(row) = point;
      }
    }
  }
  return result;
}

void EditSession::State::aim(const std::vector<HandleTarget>& targets,
                             std::shared_ptr<const StartPose> start_in) {
  check_targets(editor->handles_, targets);
  const Editor& e = *editor;
  start = std::move(start_in);
  if (start != nullptr && with_network) {
    look = e.context_->look(start->vertices, start->face_normals, start->vertex_normals);
  }
  start_stretch = start == nullptr ? BlockField() : in_blocks(start->jacobians);
  of_start.reset();
  const Points& before = from();
  positions = target_positions(targets);
  const Points on_surface = e.prepared_->mesh.to_surface(positions);
  held.resize(e.held_.size(), 3);
  for (Eigen::Index i = 0; i < e.held_slot_.size(); ++i) {
    if (e.held_slot_[i] >= 0) {
      held.row(e.held_slot_[i]) = on_surface.row(i);
    }
  }
  soft_targets = held(e.soft_->places, Eigen::all);
  Points handles_before(e.handle_rows_, 3);
  Eigen::VectorXd weights(e.handle_rows_);
  for (Eigen::Index i = 0; i < e.handle_rows_; ++i) {
    handles_before.row(i) = before.row(e.held_[i]);
    weights[i] = e.handles_[static_cast<size_t>(e.held_handle_[i])].weight;
  }
  const Matrix3 identity = Matrix3::Identity();
  std::vector<Matrix3> turns;
  std::vector<std::optional<Matrix3>> known(targets.size());
  for (size_t h = 0; h < targets.size(); ++h) {
    if (!targets[h].positions) {
      known[h] = targets[h].matrix ? row_rotation(*targets[h].matrix) : identity;
      turns.push_back(e.handles_[h].weight * *known[h]);
    }
  }
  whole = nearest_motion(handles_before, held.topRows(e.handle_rows_), weights, turns);
  // Loose pieces go with the whole in the solves, so that one rigid motion of all stays one.
  for (Eigen::Index i = e.handle_rows_; i < held.rows(); ++i) {
    held.row(i) = whole(before.row(e.held_[i]));
  }

  find_guide_rotations(handles_before, known);
  descent.reset();
  pulled.reset();
  energy.reset();
  stretch.clear();
  way.resize(0, 3);
  next = 0;
  report = EditReport{};
  report.network = with_network;
  find_kept_volumes(targets);
  aimed = true;
}

void EditSession::State::find_kept_volumes(const std::vector<HandleTarget>& targets) {
  const Editor& e = *editor;
  kept_volumes = start == nullptr ? e.volume_->at_rest() : e.volume_->in(start->vertices);
  for (Eigen::Index i = 0; i < e.handle_rows_; ++i) {
    const HandleTarget& target = targets[static_cast<size_t>(e.held_handle_[i])];
    if (target.matrix && !rigid(*target.matrix)) {
      kept_volumes[operators().component[e.held_[i]]] = 0.0;
    }
  }
  report.volume_kept = options.keep_volume && options.method == EditMethod::supple &&
                       (kept_volumes.array() > 0.0).any();
}

void EditSession::State::find_guide_rotations(const Points& handles_before,
                                              const std::vector<std::optional<Matrix3>>& known) {
  const Editor& e = *editor;
  guide_rotations.assign(static_cast<size_t>(e.guides_.size()), whole.rotation);
  MatrixField smooth;  // Jacobians of the biharmonic displacement, for what positions leave open
  for (Eigen::Index g = 0; g < e.guides_.size(); ++g) {
    const Eigen::Index guide = e.guides_[g];
    const int h = e.held_handle_[guide];
    Matrix3& rotation = guide_rotations[static_cast<size_t>(g)];
    if (h < 0) {
      continue;
    }
    if (known[static_cast<size_t>(h)]) {
      rotation = *known[static_cast<size_t>(h)];
      continue;
    }
    if (smooth.rows() == 0) {
      smooth = start == nullptr ? operators().jacobians_of(smooth_displacement())
                                : rotations_since_start(smooth_displacement());
    }
    Eigen::Index first = guide, last = guide;  // the handle's rows are contiguous
    while (first > 0 && e.held_handle_[first - 1] == h) {
      --first;
    }
    while (last < e.handle_rows_ && e.held_handle_[last] == h) {
      ++last;
    }
    const Eigen::Matrix<double, 1, 9> around = vertex_average(operators(), smooth, e.held_[guide]);
    rotation = rotation_around(handles_before.middleRows(first, last - first),
                               held.middleRows(first, last - first), handles_before.row(guide),
                               closest_rotation(Eigen::Map<const Matrix3>(around.data())));
  }
}

// The rigid motion, and biharmonic interpolation of what the handles ask besides.
Points EditSession::State::smooth_displacement() const {
  const Points& before = from();
  Points away(editor->guides_.size(), 3);
  for (Eigen::Index g = 0; g < away.rows(); ++g) {
    const int guide = editor->guides_[g];
    away.row(g) = held.row(guide) - whole(before.row(editor->held_[guide]));
  }
  Points result = editor->interpolation_->solve(away);
#pragma omp parallel for schedule(static)
  for (Eigen::Index v = 0; v < result.rows(); ++v) {
    result.row(v) += whole(before.row(v));
  }
  return result;
}

// From the rigid motion, which needs no correction where the handles ask for nothing else.
void EditSession::State::suggest() {
  const Points& before = from();
  const RowMatrix<double> turns =
      interpolated_turns(*editor->interpolation_, guide_rotations, whole.rotation);
  moved.resize(before.rows(), 3);
#pragma omp parallel for schedule(static)
  for (Eigen::Index v = 0; v < moved.rows(); ++v) {
    moved.row(v) = whole(before.row(v));
  }
  for (const int place : editor->firm_) {
    moved.row(editor->held_[place]) = held.row(place);
  }
  correct(towards_turned(*editor->faces_, moved, turns, whole.rotation, from_start()));
}

void EditSession::State::correct(Points residual) {
  editor->soft_->add_residual(moved, soft_targets, residual);
  if (!restores_next()) {
    moved += editor->poisson_->correction(residual);
    return;
  }
  // About this shape: along whatever way, the volume that is restored is counted exactly.
  auto [change, along] = editor->poisson_->corrections(residual, editor->volume_->gradient(moved));
  moved += change;
  way = std::move(along);
}

void EditSession::State::round(bool use_network) {
  const FaceBlocks& faces = *editor->faces_;
  if (!use_network) {
    correct(towards_rotations(faces, moved, from_start()));
    return;
  }
  Signal signal;
  signal.fields.push_back(rotations_since_start(moved));
  const MatrixField jacobians = editor->network_->forward(*editor->context_, signal, nullptr,
                                                          start == nullptr ? nullptr : &look);
  // Towards the stiff end less of the network's stretch is kept.
  correct(towards_bounded(faces, moved, jacobians, 1.0 - options.stiffness, kMostStretch,
                          from_start(), stretch));
}

void EditSession::State::polish_pass() {
  correct(towards_rotations(*editor->faces_, moved, stretch.empty() ? from_start() : &stretch));
}

void EditSession::State::restore_volume() {
  if (way.rows() == 0) {  // there was no round
    way = editor->poisson_->correction(editor->volume_->gradient(moved));
  }
  editor->volume_->restore(kept_volumes, way, moved);
  way.resize(0, 3);
}

void EditSession::State::pass() {
  const bool stiff = options.method == EditMethod::supple;
  if (descent == nullptr) {
    if (start != nullptr) {
      of_start = operators_of(operators(), *start);
    }
    const SurfaceOperators& before = start == nullptr ? operators() : *of_start;
    if (stiff) {
      energy = std::make_unique<StiffEnergy>(
          before, report.volume_kept ? editor->volume_.get() : nullptr, kept_volumes);
    } else {
      energy = std::make_unique<ArapEnergy>(before);
    }
    pulled = std::make_unique<PulledEnergy>(*energy, *editor->soft_, soft_targets);
    descent = std::make_unique<Descent>(*pulled, *editor->poisson_);
  }
  descent->pass(moved);
  ++report.passes;
  const bool converged = descent->converged(), late = report.passes >= passes;
  const int interval = late ? kLateFoldInterval : kFoldInterval;
  const int since = late ? report.passes - passes : report.passes;
  bool folds = late;  // not known to be gone
  if (stiff && (converged || since % interval == 0)) {
    folds = static_cast<StiffEnergy&>(*energy).stiffen_folds(moved) > 0;
    if (folds) {
      descent->forget();
    }
  }
  if (converged && !folds) {
    next = step_count() - 1;  // nothing is left to do
  } else if (stiff && late && folds && report.passes < (1.0 + kMostLatePasses) * passes) {
    --next;  // once more
  }
}

void EditSession::State::step() {
  const Stopwatch watch;
  const int first_polish = 1 + options.rounds;
  if (next == 0) {
    suggest();
    report.suggestion_milliseconds += watch.milliseconds();
  } else if (next < first_polish) {
    round(with_network && next - 1 + options.network_rounds >= options.rounds);
    ++report.rounds;
    report.rounds_milliseconds += watch.milliseconds();
  } else if (next < first_polish + polish) {
    polish_pass();
    ++report.polish;
    report.rounds_milliseconds += watch.milliseconds();
  } else if (next < usable()) {
    restore_volume();
    report.rounds_milliseconds += watch.milliseconds();
  } else {
    pass();
    report.passes_milliseconds += watch.milliseconds();
  }
  ++next;
  report.total_milliseconds += watch.milliseconds();
}

void EditSession::State::place_loose_pieces(Points& placed,
                                            const MatrixField& vertex_jacobians) const {
  const Points& before = from();
  const Eigen::VectorXi& anchor = editor->anchor_;
  std::vector<Matrix3> turn(static_cast<size_t>(anchor.size()), Matrix3::Identity());
  if (options.loose_pieces == LoosePieces::follow) {
    for (Eigen::Index c = 0; c < anchor.size(); ++c) {
      if (anchor[c] >= 0) {
        turn[static_cast<size_t>(c)] = closest_rotation(matrix_at(vertex_jacobians, anchor[c]));
      }
    }
  }
  for (Eigen::Index v = 0; v < placed.rows(); ++v) {
    const int piece = operators().component[v];
    if (anchor[piece] < 0) {
      continue;
    }
    placed.row(v) = options.loose_pieces == LoosePieces::stay
                        ? Eigen::RowVector3d(before.row(v))
                        : placed.row(anchor[piece]) + (before.row(v) - before.row(anchor[piece])) *
                                                          turn[static_cast<size_t>(piece)];
  }
}

EditResult EditSession::State::result() const {
  const Stopwatch watch;
  EditResult result;
  const TriangleMesh& mesh = editor->prepared_->mesh;
  Points placed = moved;
  MatrixField vertex_jacobians(0, 9);
  if ((editor->anchor_.array() >= 0).any() || mesh.vertices().rows() != moved.rows()) {
    vertex_jacobians = operators().average * (start == nullptr ? operators().jacobians_of(moved)
                                                               : rotations_since_start(moved));
    place_loose_pieces(placed, vertex_jacobians);
  }
  result.vertices = mesh.scatter(mesh_from(), placed, vertex_jacobians);
  Eigen::Index row = 0;
  for (const Handle& handle : editor->handles_) {
    for (const int vertex : handle.vertices) {
      if (handle.weight == 1.0) {
        result.vertices.row(vertex) = positions.row(row);
      }
      ++row;
    }
  }
  result.report = report;
  result.report.total_milliseconds += watch.milliseconds();
  return result;
}

EditSession::EditSession(std::shared_ptr<const Editor> editor, const EditOptions& options)
    : state_(std::make_unique<State>(std::move(editor), options)) {}
EditSession::~EditSession() = default;
EditSession::EditSession(EditSession&&) noexcept = default;

void EditSession::aim(const std::vector<HandleTarget>& targets,
                      std::shared_ptr<const StartPose> start) {
  state_->aim(targets, std::move(start));
}

EditResult EditSession::advance(double milliseconds) {
  if (!state_->aimed) {
    throw Error(ErrorCode::bad_option, "The session has no targets yet. Call aim first.");
  }
  const Stopwatch watch;
  if (!state_->settled()) {
    state_->step();
  }
  while (!state_->settled() &&
         (state_->next < state_->usable() || watch.milliseconds() < milliseconds)) {
    state_->step();
  }
  return state_->result();
}

bool EditSession::settled() const { return state_->aimed && state_->settled(); }

EditResult Editor::solve(const std::vector<HandleTarget>& targets, const EditOptions& options,
                         ProgressRange progress, std::shared_ptr<const StartPose> start) const {
  // The editor is not owned: the session ends before it.
  EditSession::State state({std::shared_ptr<void>(), this}, options);
  state.aim(targets, std::move(start));
  while (!state.settled()) {
    progress.report(static_cast<double>(state.next) / state.step_count());
    state.step();
  }
  progress.report(1.0);
  return state.result();
}

}  // namespace supple
