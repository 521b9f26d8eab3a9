// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <limits>
#include <utility>

#include "face_blocks.h"
#include "handle_checks.h"
#include "soft_handles.h"
#include "suggestion.h"
#include "supple/core/error.h"
#include "supple/geometry/nearest.h"
#include "supple/tasks/edit.h"
#include "volume.h"

namespace supple {
namespace {

Points rows_of(const Points& points, const std::vector<int>& indices) {
  Points result(static_cast<Eigen::Index>(indices.size()), 3);
  for (Eigen::Index i = 0; i < result.rows(); ++i) {
    result.row(i) = points.row(indices[static_cast<size_t>(i)]);
  }
  return result;
}

Eigen::VectorXi vector_of(const std::vector<int>& values) {
  return Eigen::Map<const Eigen::VectorXi>(values.data(), static_cast<Eigen::Index>(values.size()));
}

// Per component without a handle: the point nearest to it on one that has one; otherwise -1.
Eigen::VectorXi anchors(const SurfaceOperators& operators, const std::vector<bool>& has_handle) {
  Eigen::VectorXi anchor = Eigen::VectorXi::Constant(operators.component_count, -1);
  std::vector<int> firm, loose;
  for (int i = 0; i < operators.component.size(); ++i) {
    (has_handle[static_cast<size_t>(operators.component[i])] ? firm : loose).push_back(i);
  }
  if (loose.empty()) {
    return anchor;
  }
  const NearestPoints::Result nearest =
      NearestPoints(rows_of(operators.vertices, firm)).query(rows_of(operators.vertices, loose));
  Eigen::VectorXd best =
      Eigen::VectorXd::Constant(operators.component_count, std::numeric_limits<double>::max());
  for (size_t i = 0; i < loose.size(); ++i) {
    const int piece = operators.component[loose[i]];
    const auto row = static_cast<Eigen::Index>(i);
    if (nearest.squared_distance[row] < best[piece] * (1.0 - 1e-9)) {  // ties: the first
      best[piece] = nearest.squared_distance[row];
      anchor[piece] = firm[static_cast<size_t>(nearest.index[row])];
    }
  }
  return anchor;
}

// Places in `held` whose rotations are interpolated: those of each handle that stand for all of it,
// what a loose piece is held by, and one of every component that is then still without.
// groups: the handle of each, -1 for a loose piece's; a handle's places are contiguous.
Eigen::VectorXi choose_guides(const SurfaceOperators& operators, const std::vector<int>& held,
                              const std::vector<int>& groups) {
  std::vector<int> guides;
  std::vector<bool> guided(static_cast<size_t>(operators.component_count), false);
  const auto take = [&](size_t place) {
    guides.push_back(static_cast<int>(place));
    guided[static_cast<size_t>(operators.component[held[place]])] = true;
  };
  for (size_t first = 0; first < held.size();) {
    size_t last = first + 1;
    while (last < held.size() && groups[first] >= 0 && groups[last] == groups[first]) {
      ++last;
    }
    const std::vector<int> handle(held.begin() + static_cast<std::ptrdiff_t>(first),
                                  held.begin() + static_cast<std::ptrdiff_t>(last));
    for (const int place : far_apart(rows_of(operators.vertices, handle))) {
      take(first + static_cast<size_t>(place));
    }
    first = last;
  }
  for (size_t place = 0; place < held.size(); ++place) {
    if (!guided[static_cast<size_t>(operators.component[held[place]])]) {
      take(place);
    }
  }
  return vector_of(guides);
}

// The places that are on their targets exactly, and the pulls of the others. groups: as above.
std::pair<Eigen::VectorXi, SoftHandles> by_weight(const SurfaceOperators& operators,
                                                  const std::vector<Handle>& handles,
                                                  const std::vector<int>& held,
                                                  const std::vector<int>& groups) {
  Eigen::VectorXd mass = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(handles.size()));
  std::vector<int> firm, places, vertices;
  for (size_t place = 0; place < held.size(); ++place) {
    const int h = groups[place];
    if (h < 0 || handles[static_cast<size_t>(h)].weight == 1.0) {
      firm.push_back(static_cast<int>(place));
    } else {
      mass[h] += operators.mass[held[place]];
      places.push_back(static_cast<int>(place));
      vertices.push_back(held[place]);
    }
  }
  SoftHandles soft{vector_of(places), vector_of(vertices),
                   Eigen::VectorXd(static_cast<Eigen::Index>(places.size()))};
  for (Eigen::Index i = 0; i < soft.pull.size(); ++i) {
    const int h = groups[static_cast<size_t>(soft.places[i])];
    soft.pull[i] = pull_of(handles[static_cast<size_t>(h)].weight) *
                   operators.mass[soft.vertices[i]] / mass[h];
  }
  return {vector_of(firm), std::move(soft)};
}

// A guide's compliance each. guides: places; groups: the handle of each place.
Eigen::VectorXd compliances(const std::vector<Handle>& handles, const Eigen::VectorXi& guides,
                            const Eigen::VectorXi& groups) {
  const auto shared_by = [&](int group) {
    return std::count_if(guides.begin(), guides.end(),
                         [&](int place) { return groups[place] == group; });
  };
  Eigen::VectorXd result = Eigen::VectorXd::Zero(guides.size());
  for (Eigen::Index g = 0; g < guides.size(); ++g) {
    const int h = groups[guides[g]];
    const double weight = h < 0 ? 1.0 : handles[static_cast<size_t>(h)].weight;
    if (weight < 1.0) {  // else it is 0, and counting the guides for nothing
      result[g] = compliance_of(weight, shared_by(h));
    }
  }
  return result;
}

}  // namespace

EditMethod edit_method(const std::string& name) {
  if (name == "supple") {
    return EditMethod::supple;
  }
  if (name == "arap") {
    return EditMethod::arap;
  }
  throw Error(ErrorCode::bad_option, "'" + name + "' is no method. Use 'supple' or 'arap'.");
}

Editor::Editor(std::shared_ptr<const PreparedMesh> prepared, std::vector<Handle> handles,
               std::shared_ptr<const LocalJacobianNetwork<float>> network, ProgressRange progress,
               const Editor* former)
    : prepared_(std::move(prepared)), handles_(std::move(handles)), network_(std::move(network)) {
  check_handles(handles_, prepared_->mesh.vertices().rows());
  if (network_ != nullptr) {
    if (network_->architecture().signal != SignalKind::rotation) {
      throw Error(
          ErrorCode::bad_option,
          "This network takes the spectral signal. Editing needs one trained on rotations.");
    }
    context_ = prepared_->context_for(network_->architecture());
  }
  bind(former != nullptr && former->prepared_ == prepared_ ? former : nullptr, progress);
  progress.report(1.0);
}

void Editor::bind(const Editor* former, const ProgressRange& progress) {
  const TriangleMesh& mesh = prepared_->mesh;
  const SurfaceOperators& operators = prepared_->operators;
  std::vector<int> held, slots, groups;
  std::vector<bool> has_handle(static_cast<size_t>(operators.component_count), false);
  for (size_t h = 0; h < handles_.size(); ++h) {
    for (const int vertex : handles_[h].vertices) {
      const int surface = mesh.surface_vertex()[vertex];
      slots.push_back(surface < 0 ? -1 : static_cast<int>(held.size()));
      if (surface >= 0) {
        held.push_back(surface);
        groups.push_back(static_cast<int>(h));
        has_handle[static_cast<size_t>(operators.component[surface])] = true;
      }
    }
  }
  if (held.empty()) {
    throw Error(ErrorCode::no_handles,
                "No handle has a vertex of a face with an area, so nothing can follow them.");
  }
  handle_rows_ = static_cast<Eigen::Index>(held.size());
  // Loose pieces go with the whole in the solves and are placed afterwards.
  anchor_ = anchors(operators, has_handle);
  std::vector<bool> met(has_handle);
  for (int i = 0; i < operators.component.size(); ++i) {
    const auto piece = static_cast<size_t>(operators.component[i]);
    if (!met[piece]) {
      met[piece] = true;
      held.push_back(i);
      groups.push_back(-1);
    }
  }
  held_ = vector_of(held);
  held_slot_ = vector_of(slots);
  held_handle_ = vector_of(groups);

  guides_ = choose_guides(operators, held, groups);
  Eigen::VectorXi points(guides_.size());
  for (Eigen::Index g = 0; g < points.size(); ++g) {
    points[g] = held_[guides_[g]];
  }
  auto [firm, soft] = by_weight(operators, handles_, held, groups);
  firm_ = std::move(firm);
  soft_ = std::make_shared<const SoftHandles>(std::move(soft));
  const Eigen::VectorXi firm_vertices = held_(firm_);
  progress.report(0.1);
  if (former != nullptr && *former->soft_ == *soft_) {
    if (std::optional<HeldSystem> changed = former->poisson_->changed(firm_vertices)) {
      poisson_ = std::make_shared<const HeldSystem>(std::move(*changed));
    }
  }
  if (poisson_ == nullptr) {
    poisson_ = std::make_shared<const HeldSystem>(soft_->added_to(operators.laplacian),
                                                  firm_vertices, prepared_->symbolic);
  }
  progress.report(0.5);
  volume_ = former == nullptr ? std::make_shared<const EnclosedVolume>(operators) : former->volume_;
  faces_ = former == nullptr ? std::make_shared<const FaceBlocks>(operators) : former->faces_;
  interpolation_ = std::make_shared<const BiharmonicInterpolation>(
      prepared_->pinned(), std::move(points),
      former == nullptr ? nullptr : former->interpolation_.get(),
      compliances(handles_, guides_, held_handle_));
}

}  // namespace supple
