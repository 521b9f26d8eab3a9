// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/tasks/edit.h"

#include <Eigen/LU>
#include <chrono>
#include <cmath>

#include "handle_checks.h"
#include "supple/core/error.h"
#include "supple/geometry/jacobians.h"
#include "supple/geometry/nearest.h"

namespace supple {
namespace {

class Stopwatch {
 public:
  double milliseconds() const {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start_)
        .count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

Matrix3 row_rotation(const Eigen::Matrix4d& matrix) {
  return closest_rotation(Matrix3(matrix.topLeftCorner<3, 3>().transpose()));
}

}  // namespace

EditMode edit_mode(const std::string& name) {
  if (name == "natural") {
    return EditMode::natural;
  }
  if (name == "stiff") {
    return EditMode::stiff;
  }
  throw Error(ErrorCode::bad_option, "'" + name + "' is no mode. Use 'natural' or 'stiff'.");
}

Editor::Editor(std::shared_ptr<const PreparedMesh> prepared, std::vector<Handle> handles,
               std::shared_ptr<const LocalJacobianNetwork<float>> network, ProgressRange progress)
    : prepared_(std::move(prepared)), handles_(std::move(handles)), network_(std::move(network)) {
  const TriangleMesh& mesh = prepared_->mesh;
  const SurfaceOperators& operators = prepared_->operators;
  check_handles(handles_, mesh.vertices().rows());
  if (network_ != nullptr) {
    if (network_->architecture().signal != SignalKind::rotation) {
      throw Error(
          ErrorCode::bad_option,
          "This network takes the spectral signal. Editing needs one trained on rotations.");
    }
    context_ = prepared_->context_for(network_->architecture());
  }

  std::vector<int> held, slots;
  std::vector<bool> has_handle(static_cast<size_t>(operators.component_count), false);
  for (const Handle& handle : handles_) {
    for (const int vertex : handle.vertices) {
      const int surface = mesh.surface_vertex()[vertex];
      slots.push_back(surface < 0 ? -1 : static_cast<int>(held.size()));
      if (surface >= 0) {
        held.push_back(surface);
        has_handle[static_cast<size_t>(operators.component[surface])] = true;
      }
    }
  }
  if (held.empty()) {
    throw Error(ErrorCode::no_handles,
                "No handle has a vertex of a face with an area, so nothing can follow them.");
  }
  handle_rows_ = static_cast<Eigen::Index>(held.size());

  // Loose pieces are held in the solves and placed afterwards; their anchors are the nearest points
  // of pieces with handles.
  anchor_.setConstant(operators.component_count, -1);
  std::vector<int> firm;
  for (int i = 0; i < operators.component.size(); ++i) {
    if (has_handle[static_cast<size_t>(operators.component[i])]) {
      firm.push_back(i);
    } else {
      held.push_back(i);
    }
  }
  if (static_cast<Eigen::Index>(held.size()) > handle_rows_) {
    Points firm_points(static_cast<Eigen::Index>(firm.size()), 3);
    for (size_t i = 0; i < firm.size(); ++i) {
      firm_points.row(static_cast<Eigen::Index>(i)) = operators.vertices.row(firm[i]);
    }
    Points loose_points(static_cast<Eigen::Index>(held.size()) - handle_rows_, 3);
    for (Eigen::Index i = 0; i < loose_points.rows(); ++i) {
      loose_points.row(i) = operators.vertices.row(held[static_cast<size_t>(handle_rows_ + i)]);
    }
    const NearestPoints::Result nearest = NearestPoints(std::move(firm_points)).query(loose_points);
    Eigen::VectorXd best =
        Eigen::VectorXd::Constant(operators.component_count, std::numeric_limits<double>::max());
    for (Eigen::Index i = 0; i < loose_points.rows(); ++i) {
      const int piece = operators.component[held[static_cast<size_t>(handle_rows_ + i)]];
      if (nearest.squared_distance[i] < best[piece] * (1.0 - 1e-9)) {  // ties: the first
        best[piece] = nearest.squared_distance[i];
        anchor_[piece] = firm[static_cast<size_t>(nearest.index[i])];
      }
    }
  }
  held_ = Eigen::Map<Eigen::VectorXi>(held.data(), static_cast<Eigen::Index>(held.size()));
  held_slot_ = Eigen::Map<Eigen::VectorXi>(slots.data(), static_cast<Eigen::Index>(slots.size()));

  poisson_ = std::make_unique<HeldSystem>(operators.laplacian, held_, prepared_->symbolic);
  progress.report(0.3);
  const PreparedMesh::Biharmonic& biharmonic = prepared_->biharmonic();
  biharmonic_ = std::make_unique<HeldSystem>(biharmonic.matrix, held_, biharmonic.symbolic);
  progress.report(1.0);
}

Points Editor::target_positions(const std::vector<HandleTarget>& targets) const {
  const Points& rest = prepared_->mesh.vertices();
  Points result(held_slot_.size(), 3);
  Eigen::Index row = 0;
  for (size_t h = 0; h < handles_.size(); ++h) {
    for (Eigen::Index i = 0; i < handles_[h].vertices.size(); ++i, ++row) {
      const Eigen::RowVector3d point = rest.row(handles_[h].vertices[i]);
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

Points Editor::moved_as_one(const std::vector<HandleTarget>& targets, const Points& held) const {
  const Points& rest = prepared_->operators.vertices;
  Eigen::RowVector3d from = Eigen::RowVector3d::Zero(), to = from;
  for (Eigen::Index i = 0; i < handle_rows_; ++i) {
    from += rest.row(held_[i]) / static_cast<double>(handle_rows_);
    to += held.row(i) / static_cast<double>(handle_rows_);
  }
  Matrix3 correlation = Matrix3::Zero();
  for (Eigen::Index i = 0; i < handle_rows_; ++i) {
    correlation += (rest.row(held_[i]) - from).transpose() * (held.row(i) - to);
  }
  // A handle that knows its rotation counts like three more points at a tenth of the surface's
  // size: enough to decide where the points alone leave a turn open (one vertex, a straight line).
  constexpr double kRadius = 0.1;
  for (size_t h = 0; h < handles_.size(); ++h) {
    if (!targets[h].positions) {
      const Matrix3 turn =
          targets[h].matrix ? row_rotation(*targets[h].matrix) : Matrix3(Matrix3::Identity());
      correlation += kRadius * kRadius * turn;
    }
  }
  // Where a turn is still open, the smallest.
  correlation += 1e-13 * correlation.norm() * Matrix3::Identity();
  if (correlation.norm() == 0.0) {
    correlation.setIdentity();
  }
  const Matrix3 rotation = closest_rotation(correlation);
  return ((rest.rowwise() - from) * rotation).rowwise() + to;
}

Points Editor::suggestion(const Points& rigid, const Points& held) const {
  Points displacement(held_.size(), 3);
  for (Eigen::Index i = 0; i < held_.size(); ++i) {
    displacement.row(i) = held.row(i) - rigid.row(held_[i]);
  }
  return rigid + biharmonic_->solve(Points::Zero(rigid.rows(), 3), displacement);
}

void Editor::place_loose_pieces(Points& moved, const MatrixField& vertex_jacobians,
                                LoosePieces choice) const {
  const Points& rest = prepared_->operators.vertices;
  std::vector<Matrix3> turn(static_cast<size_t>(anchor_.size()), Matrix3::Identity());
  for (Eigen::Index c = 0; c < anchor_.size(); ++c) {
    if (anchor_[c] >= 0 && choice == LoosePieces::follow) {
      turn[static_cast<size_t>(c)] = closest_rotation(matrix_at(vertex_jacobians, anchor_[c]));
    }
  }
  for (Eigen::Index i = handle_rows_; i < held_.size(); ++i) {
    const int vertex = held_[i], piece = prepared_->operators.component[vertex];
    const int anchor = anchor_[piece];
    moved.row(vertex) = choice == LoosePieces::stay
                            ? Eigen::RowVector3d(rest.row(vertex))
                            : moved.row(anchor) + (rest.row(vertex) - rest.row(anchor)) *
                                                      turn[static_cast<size_t>(piece)];
  }
}

EditResult Editor::solve(const std::vector<HandleTarget>& targets, const EditOptions& options,
                         ProgressRange progress) const {
  check_targets(handles_, targets);
  if (options.rounds < 0 || options.passes < 0 || options.network_rounds < 0) {
    throw Error(ErrorCode::bad_option, "Rounds and passes must be 0 or more.");
  }
  const TriangleMesh& mesh = prepared_->mesh;
  const SurfaceOperators& operators = prepared_->operators;
  const Stopwatch total;
  EditResult result;

  const Points positions = target_positions(targets);
  const Points on_surface = mesh.to_surface(positions);
  Points held(held_.size(), 3);
  for (Eigen::Index i = 0; i < held_slot_.size(); ++i) {
    if (held_slot_[i] >= 0) {
      held.row(held_slot_[i]) = on_surface.row(i);
    }
  }
  // Loose pieces go with the whole in the solves, so that one rigid motion of all stays one.
  const Points rigid = moved_as_one(targets, held);
  for (Eigen::Index i = handle_rows_; i < held_.size(); ++i) {
    held.row(i) = rigid.row(held_[i]);
  }

  Points moved = suggestion(rigid, held);
  result.report.suggestion_milliseconds = total.milliseconds();

  const bool with_network =
      options.network && network_ != nullptr && options.rounds > 0 && options.network_rounds > 0;
  const int passes = options.mode == EditMode::stiff ? options.passes : 0;
  const Stopwatch rounds_watch;
  for (int round = 0; round < options.rounds; ++round) {
    progress.report(static_cast<double>(round) / (options.rounds + passes));
    const Signal signal = rotation_signal(operators.jacobians_of(moved));
    const bool use_network = with_network && round + options.network_rounds >= options.rounds;
    const MatrixField jacobians =
        use_network ? network_->forward(*context_, signal) : signal.fields.front();
    moved = poisson_->solve(operators.divergence_of(jacobians), held);
  }
  result.report.rounds_milliseconds = rounds_watch.milliseconds();

  const Stopwatch passes_watch;
  for (int pass = 0; pass < passes; ++pass) {
    progress.report(static_cast<double>(options.rounds + pass) / (options.rounds + passes));
    const MatrixField rotations = closest_rotations(operators.jacobians_of(moved));
    moved = poisson_->solve(operators.divergence_of(rotations), held);
  }
  result.report.passes_milliseconds = passes_watch.milliseconds();

  const MatrixField vertex_jacobians = operators.average * operators.jacobians_of(moved);
  place_loose_pieces(moved, vertex_jacobians, options.loose_pieces);
  result.vertices = mesh.scatter(moved, vertex_jacobians);
  Eigen::Index row = 0;
  for (const Handle& handle : handles_) {
    for (const int vertex : handle.vertices) {
      result.vertices.row(vertex) = positions.row(row++);
    }
  }
  result.report.rounds = options.rounds;
  result.report.passes = passes;
  result.report.network = with_network;
  result.report.total_milliseconds = total.milliseconds();
  progress.report(1.0);
  return result;
}

}  // namespace supple
