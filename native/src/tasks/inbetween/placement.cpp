// SPDX-License-Identifier: GPL-3.0-or-later
#include "placement.h"

#include <algorithm>
#include <utility>

#include "supple/geometry/nearest.h"

namespace supple {
namespace {

// Added to a variance, as part of the component's mean: a vertex that stands still counts for no
// more than a million that move with the rest.
constexpr double kStill = 1e-6;

struct Keys {
  const PreparedMesh& prepared;
  const std::vector<Points>& poses;
  const std::vector<MatrixField>& rotations;

  // K x 3: a mesh vertex in a frame at each key.
  Points places(int vertex, int frame_vertex, int frame_face) const {
    Points result(static_cast<Eigen::Index>(poses.size()), 3);
    for (size_t k = 0; k < poses.size(); ++k) {
      Eigen::RowVector3d place = poses[k].row(vertex);
      if (frame_vertex >= 0) {
        place -= poses[k].row(prepared.mesh.mesh_vertex()[frame_vertex]);
        place *= matrix_at(rotations[k], frame_face).transpose();
      }
      result.row(static_cast<Eigen::Index>(k)) = place;
    }
    return result;
  }
};

double variance(const Points& places) {
  return (places.rowwise() - places.colwise().mean()).squaredNorm() /
         static_cast<double>(places.rows());
}

int largest_face_at(const SurfaceOperators& operators, int vertex) {
  const CornerTable& corners = operators.corners;
  int best = corners.corner[corners.first[vertex]] / 3;
  for (int i = corners.first[vertex]; i < corners.first[vertex + 1]; ++i) {
    const int f = corners.corner[i] / 3;
    best = operators.face_areas[f] > operators.face_areas[best] ? f : best;
  }
  return best;
}

// Some mesh vertices with their weighted mean's track: in the frame at a surface vertex (-1: the
// world's alone) where they move less in that, otherwise in the world's.
struct Group {
  Track track;
  Eigen::VectorXd shares;
};
Group follow(const Keys& keys, const std::vector<int>& vertices, const Eigen::VectorXd& masses,
             int anchor) {
  const int face = anchor < 0 ? -1 : largest_face_at(keys.prepared.operators, anchor);
  const auto variances_in = [&](int frame_vertex) {
    Eigen::VectorXd result(masses.size());
    for (Eigen::Index i = 0; i < result.size(); ++i) {
      result[i] = variance(keys.places(vertices[static_cast<size_t>(i)], frame_vertex, face));
    }
    return result;
  };
  Eigen::VectorXd variances = variances_in(-1);
  Group group;
  if (anchor >= 0) {
    Eigen::VectorXd relative = variances_in(anchor);
    if (masses.dot(relative) < masses.dot(variances)) {
      group.track.vertex = anchor;
      group.track.face = face;
      variances = std::move(relative);
    }
  }
  const double mean = masses.dot(variances) / masses.sum();
  group.shares =
      mean > 0.0 ? Eigen::VectorXd(masses.array() / (variances.array() + kStill * mean)) : masses;
  group.shares /= group.shares.sum();
  group.track.places = Points::Zero(static_cast<Eigen::Index>(keys.poses.size()), 3);
  for (Eigen::Index i = 0; i < masses.size(); ++i) {
    const int vertex = vertices[static_cast<size_t>(i)];
    group.track.places +=
        group.shares[i] * keys.places(vertex, group.track.vertex, group.track.face);
  }
  return group;
}

int largest_component(const SurfaceOperators& operators) {
  Eigen::VectorXd mass = Eigen::VectorXd::Zero(operators.component_count);
  for (Eigen::Index v = 0; v < operators.mass.size(); ++v) {
    mass[operators.component[v]] += operators.mass[v];
  }
  int best = 0;
  for (int c = 1; c < mass.size(); ++c) {  // ties: the first
    best = mass[c] > mass[best] * (1.0 + 1e-9) ? c : best;
  }
  return best;
}

// For each component the vertex of the largest that is nearest to it at rest; -1 for that itself.
std::vector<int> anchors_of(const SurfaceOperators& operators, int largest) {
  std::vector<int> of_largest, others, anchors(static_cast<size_t>(operators.component_count), -1);
  for (int v = 0; v < operators.component.size(); ++v) {
    (operators.component[v] == largest ? of_largest : others).push_back(v);
  }
  if (others.empty()) {
    return anchors;
  }
  const NearestPoints::Result nearest = NearestPoints(operators.vertices(of_largest, Eigen::all))
                                            .query(operators.vertices(others, Eigen::all));
  std::vector<double> best(anchors.size());
  for (size_t i = 0; i < others.size(); ++i) {
    const auto piece = static_cast<size_t>(operators.component[others[i]]);
    const auto row = static_cast<Eigen::Index>(i);
    const double distance = nearest.squared_distance[row];
    if (anchors[piece] < 0 || distance < best[piece] * (1.0 - 1e-9)) {  // ties: the first
      best[piece] = distance;
      anchors[piece] = of_largest[static_cast<size_t>(nearest.index[row])];
    }
  }
  return anchors;
}

}  // namespace

Eigen::RowVector3d Track::at(const KeyWeights& weights, const Points& moved,
                             const MatrixField& rotations) const {
  const Eigen::RowVector3d place =
      weights.of(Eigen::RowVector3d(0.0, 0.0, 0.0), [&](Eigen::Index k) { return places.row(k); });
  return vertex < 0 ? place
                    : Eigen::RowVector3d(moved.row(vertex) + place * matrix_at(rotations, face));
}

Placement::Placement(const PreparedMesh& prepared, const std::vector<Points>& poses,
                     const std::vector<MatrixField>& rotations)
    : component_(prepared.operators.component),
      largest_(largest_component(prepared.operators)),
      shares_(prepared.operators.mass.size()) {
  const TriangleMesh& mesh = prepared.mesh;
  const SurfaceOperators& operators = prepared.operators;
  const Keys keys{prepared, poses, rotations};

  std::vector<std::vector<int>> members(static_cast<size_t>(operators.component_count));
  for (int v = 0; v < component_.size(); ++v) {
    members[static_cast<size_t>(component_[v])].push_back(v);
  }
  const std::vector<int> anchors = anchors_of(operators, largest_);
  for (size_t c = 0; c < members.size(); ++c) {
    std::vector<int> vertices;
    for (const int v : members[c]) {
      vertices.push_back(mesh.mesh_vertex()[v]);
    }
    Group group = follow(keys, vertices, operators.mass(members[c]), anchors[c]);
    shares_(members[c]) = group.shares;
    tracks_.push_back(std::move(group.track));
  }

  for (int v = 0; v < mesh.surface_vertex().size(); ++v) {
    if (mesh.surface_vertex()[v] < 0) {
      unattached_.push_back(v);
    }
  }
  if (!unattached_.empty()) {
    const Points rest = mesh.to_surface(mesh.vertices());
    const Eigen::VectorXi nearest =
        NearestPoints(operators.vertices).query(rest(unattached_, Eigen::all)).index;
    for (size_t i = 0; i < unattached_.size(); ++i) {
      unattached_tracks_.push_back(follow(keys, {unattached_[i]}, Eigen::VectorXd::Ones(1),
                                          nearest[static_cast<Eigen::Index>(i)])
                                       .track);
    }
  }
}

std::vector<int> Placement::guides() const {
  std::vector<int> result;
  for (const Track& track : tracks_) {
    result.push_back(track.face);
  }
  return result;
}

void Placement::place(const KeyWeights& weights, const MatrixField& rotations,
                      Points& moved) const {
  Points shift = Points::Zero(static_cast<Eigen::Index>(tracks_.size()), 3);
  for (Eigen::Index v = 0; v < moved.rows(); ++v) {
    shift.row(component_[v]) -= shares_[v] * moved.row(v);
  }
  for (Eigen::Index c = 0; c < shift.rows(); ++c) {
    shift.row(c) += tracks_[static_cast<size_t>(c)].at(weights, moved, rotations);
  }
  // What is followed is on the largest component, which follows nothing, and moves with it.
  for (Eigen::Index c = 0; c < shift.rows(); ++c) {
    if (tracks_[static_cast<size_t>(c)].vertex >= 0) {
      shift.row(c) += shift.row(largest_);
    }
  }
  for (Eigen::Index v = 0; v < moved.rows(); ++v) {
    moved.row(v) += shift.row(component_[v]);
  }
}

void Placement::place_unattached(const KeyWeights& weights, const Points& moved,
                                 const MatrixField& rotations, Points& all) const {
  for (size_t i = 0; i < unattached_.size(); ++i) {
    all.row(unattached_[i]) = unattached_tracks_[i].at(weights, moved, rotations);
  }
}

}  // namespace supple
