// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/geodesics.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>
#include <queue>
#include <string>
#include <utility>
#include <vector>

#include "supple/core/error.h"
#include "supple/geometry/mesh.h"

namespace supple {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// Lengths that differ by less than this part count as equal: rounding must not drop a path.
constexpr double kRounding = 1e-11;
// Sources between two looks at the progress, a thread.
constexpr Eigen::Index kSourcesBetweenReports = 16;
// Windows between two looks at the targets.
constexpr int64_t kWindowsBetweenLooks = 16;

// A bundle of straight lines into a face across its side `side` (3 f + c, from corner c to the
// next), in the plane of that face with the side on the x axis from 0. They come from the unfolded
// place (x, -y) of a vertex that is `before` away, and cross the side between `from` and `to`.
// With side -1: the vertex `vertex`, reached, from which lines go everywhere.
struct Window {
  double key;  // the least length of its lines
  int side;
  int vertex;
  double from, to, x, y, before;
  bool operator<(const Window& other) const { return key > other.key; }  // the nearest comes first
};

double key_of(const Window& w) {
  const double past = std::max({0.0, w.from - w.x, w.x - w.to});
  return w.before + std::hypot(past, w.y);
}

}  // namespace

struct Geodesics::Impl {
  Impl(const Points& vertices, const Faces& all_faces);

  Eigen::Index n = 0;
  Faces faces;
  Eigen::VectorXd length;  // 3 m, of each side
  Points apex;             // 3 m: x and y of the corner across each side, in the side's frame
  std::vector<std::array<int, 2>> across_range;  // 3 m: into `across`, the others on that edge
  std::vector<int> across;                       // sides, 3 f + c
  std::vector<std::vector<int>> corners;         // n: 3 f + c with that corner
  std::vector<char> turns;                       // n: whether shortest paths can turn at it

  int start(int side) const { return faces.data()[side]; }
  int end(int side) const { return faces.data()[next(side)]; }
  static int next(int side) { return side % 3 == 2 ? side - 2 : side + 1; }
  static int previous(int side) { return side % 3 == 0 ? side + 2 : side - 1; }

  void join_sides();
  void find_turns();
  class Front;
};

Geodesics::Impl::Impl(const Points& vertices, const Faces& all_faces) : n(vertices.rows()) {
  if (!vertices.allFinite()) {
    throw Error(ErrorCode::not_finite, "The vertices hold NaN or infinity.");
  }
  if (all_faces.size() > 0 && (all_faces.minCoeff() < 0 || all_faces.maxCoeff() >= n)) {
    throw Error(ErrorCode::index_out_of_range,
                "A face names a vertex outside 0 to " + std::to_string(n - 1) + ".");
  }
  std::vector<int> kept;
  for (Eigen::Index f = 0; f < all_faces.rows(); ++f) {
    if (!is_degenerate(vertices, all_faces, f)) {
      kept.push_back(static_cast<int>(f));
    }
  }
  faces = all_faces(kept, Eigen::all);
  length.resize(faces.size());
  apex = Points::Zero(faces.size(), 3);
  corners.resize(static_cast<size_t>(n));
  for (int side = 0; side < faces.size(); ++side) {
    const Eigen::RowVector3d a = vertices.row(start(side));
    const Eigen::RowVector3d along = vertices.row(end(side)) - a;
    const Eigen::RowVector3d up = vertices.row(start(previous(side))) - a;
    length[side] = along.norm();
    apex(side, 0) = up.dot(along) / length[side];
    apex(side, 1) = along.cross(up).norm() / length[side];
    corners[static_cast<size_t>(start(side))].push_back(side);
  }
  join_sides();
  find_turns();
}

void Geodesics::Impl::join_sides() {
  std::map<std::pair<int, int>, std::vector<int>> edges;
  for (int side = 0; side < faces.size(); ++side) {
    edges[std::minmax(start(side), end(side))].push_back(side);
  }
  for (int side = 0; side < faces.size(); ++side) {
    const int first = static_cast<int>(across.size());
    for (const int other : edges[std::minmax(start(side), end(side))]) {
      if (other != side) {
        across.push_back(other);
      }
    }
    across_range.push_back({first, static_cast<int>(across.size())});
  }
}

// Where there is more angle than in the plane, at boundaries, and where sheets meet.
void Geodesics::Impl::find_turns() {
  turns.assign(static_cast<size_t>(n), 0);
  for (Eigen::Index v = 0; v < n; ++v) {
    const std::vector<int>& around = corners[static_cast<size_t>(v)];
    double angle = 0.0;
    bool regular = true;
    for (const int side : around) {
      angle += std::atan2(apex(side, 1), apex(side, 0));
      for (const int edge : {side, previous(side)}) {
        const auto [first, last] = across_range[static_cast<size_t>(edge)];
        regular = regular && last - first == 1;
      }
    }
    if (regular && !around.empty()) {  // one fan, or several that share the vertex only?
      size_t count = 1;
      int side = around[0];
      int out = previous(side);
      while (count <= around.size()) {
        const int other = across[static_cast<size_t>(across_range[static_cast<size_t>(out)][0])];
        side = start(other) == v ? other : next(other);
        if (side == around[0]) {
          break;
        }
        out = side == other ? previous(side) : side;
        ++count;
      }
      regular = count == around.size();
    }
    turns[static_cast<size_t>(v)] =
        static_cast<char>(!regular || angle > 2.0 * std::numbers::pi * (1.0 + 1e-9));
  }
}

// One source's search. Kept for the next source, as are its arrays.
class Geodesics::Impl::Front {
 public:
  explicit Front(const Impl& mesh)
      : mesh_(mesh),
        distance_(static_cast<size_t>(mesh.n), kInfinity),
        split_(static_cast<size_t>(mesh.faces.size()), {kInfinity, 0.0}) {}

  // Searches until every target is reached, or to the end where there is none.
  void run(int source, const std::vector<int>& targets) {
    for (const int v : reached_) {
      distance_[static_cast<size_t>(v)] = kInfinity;
    }
    for (const int side : split_sides_) {
      split_[static_cast<size_t>(side)] = {kInfinity, 0.0};
    }
    reached_.clear();
    split_sides_.clear();
    windows_ = {};
    distance_[static_cast<size_t>(source)] = 0.0;
    reached_.push_back(source);
    leave(source);
    for (int64_t count = 0; !windows_.empty(); ++count) {
      const Window window = windows_.top();
      if (count % kWindowsBetweenLooks == 0 && !targets.empty() &&
          window.key >= farthest(targets)) {
        return;
      }
      windows_.pop();
      if (window.side >= 0) {
        cross(window);
      } else if (window.key <= distance_[static_cast<size_t>(window.vertex)]) {
        leave(window.vertex);
      }
    }
  }
  double distance(int v) const { return distance_[static_cast<size_t>(v)]; }

 private:
  double farthest(const std::vector<int>& targets) const {
    double most = 0.0;
    for (const int v : targets) {
      most = std::max(most, distance(v));
    }
    return most;
  }

  void improve(int v, double length) {
    double& best = distance_[static_cast<size_t>(v)];
    if (length < best * (1.0 - kRounding) || best == kInfinity) {
      if (best == kInfinity) {
        reached_.push_back(v);
      }
      best = length;
      if (mesh_.turns[static_cast<size_t>(v)] != 0) {
        windows_.push({length, -1, v, 0.0, 0.0, 0.0, 0.0, 0.0});
      }
    }
  }

  // Along the edges of a vertex that is reached, and across the sides that it faces.
  void leave(int v) {
    const double before = distance(v);
    for (const int side : mesh_.corners[static_cast<size_t>(v)]) {
      const int out = next(side);
      improve(mesh_.end(side), before + mesh_.length[side]);
      improve(mesh_.end(out), before + mesh_.length[previous(side)]);
      send(out, 0.0, mesh_.length[out], mesh_.apex(out, 0), mesh_.apex(out, 1), before);
    }
  }

  // Lines from (x, y) inside the face of `side` that leave across it, to the faces beyond.
  void send(int side, double from, double to, double x, double y, double before) {
    const double size = mesh_.length[side];
    from = std::max(from, 0.0);
    to = std::min(to, size);
    if (to - from <= kRounding * size) {
      return;
    }
    // Xin and Wang: where the far end is reached sooner along the edge, so is all before it.
    const double near_start = distance(mesh_.start(side)), near_end = distance(mesh_.end(side));
    const double slack = 1.0 + kRounding;
    if (before + std::hypot(x - to, y) > (near_start + to) * slack ||
        before + std::hypot(x - from, y) > (near_end + size - from) * slack) {
      return;
    }
    const auto [first, last] = mesh_.across_range[static_cast<size_t>(side)];
    for (int i = first; i < last; ++i) {
      const int other = mesh_.across[static_cast<size_t>(i)];
      const bool same = mesh_.start(other) == mesh_.start(side);
      Window w{
          0.0, other, -1, same ? from : size - to, same ? to : size - from, same ? x : size - x,
          y,   before};
      w.key = key_of(w);
      windows_.push(w);
    }
  }

  // A window goes through its face, to the corner across and to the two other sides.
  void cross(const Window& w) {
    const int right = next(w.side), left = previous(w.side);
    const double size = mesh_.length[w.side];
    const double px = mesh_.apex(w.side, 0), py = mesh_.apex(w.side, 1);
    const int corner = mesh_.start(left);
    const double split = w.x + (px - w.x) * w.y / (w.y + py);  // where the line to the corner is
    bool to_left = split > w.from, to_right = split < w.to;
    const double slack = 1e-9 * size;
    if (split >= w.from - slack && split <= w.to + slack) {
      const double length = w.before + std::hypot(px - w.x, py + w.y);
      if (length < distance(corner)) {
        improve(corner, length);
        for (const int side : mesh_.corners[static_cast<size_t>(corner)]) {
          improve(mesh_.end(side), length + mesh_.length[side]);
          improve(mesh_.start(previous(side)), length + mesh_.length[previous(side)]);
        }
      }
      auto& [best, place] = split_[static_cast<size_t>(w.side)];
      if (length <= best) {
        if (best == kInfinity) {
          split_sides_.push_back(w.side);
        }
        best = length;
        place = split;
      } else if (length > best * (1.0 + kRounding) && std::abs(split - place) > slack) {
        // Chen and Han: of two bundles to a corner, the longer one goes on to its own side only.
        (split < place ? to_right : to_left) = false;
      }
    }
    // Lines through (b, 0) meet the left side, from (0, 0) to the corner, at the part u of it.
    if (to_left) {
      const auto part = [&](double b) { return b * w.y / (px * w.y - py * (b - w.x)); };
      const double l = mesh_.length[left];
      const double from = l * (1.0 - (w.to < split ? part(w.to) : 1.0));
      const double to = l * (1.0 - (w.from > 0.0 ? part(w.from) : 0.0));
      const double along = (w.x * px - w.y * py) / l, away = (w.y * px + w.x * py) / l;
      send(left, from, to, l - along, std::max(away, 0.0), w.before);
    }
    if (to_right) {  // the same from (size, 0)
      const double qx = px - size, sx = w.x - size;
      const auto part = [&](double b) { return (b - size) * w.y / (qx * w.y - py * (b - w.x)); };
      const double l = mesh_.length[right];
      const double from = l * (w.to < size ? part(w.to) : 0.0);
      const double to = l * (w.from > split ? part(w.from) : 1.0);
      const double along = (sx * qx - w.y * py) / l, away = -(w.y * qx + sx * py) / l;
      send(right, from, to, along, std::max(away, 0.0), w.before);
    }
  }

  const Impl& mesh_;
  std::vector<double> distance_;
  std::vector<std::pair<double, double>> split_;  // each side: shortest to the corner, and where
  std::vector<int> reached_, split_sides_;
  std::priority_queue<Window> windows_;
};

Geodesics::Geodesics(const Points& vertices, const Faces& faces)
    : impl_(std::make_unique<const Impl>(vertices, faces)) {}
Geodesics::~Geodesics() = default;

namespace {

void check_vertex(int vertex, Eigen::Index n) {
  if (vertex < 0 || vertex >= n) {
    throw Error(ErrorCode::index_out_of_range, "Vertex " + std::to_string(vertex) +
                                                   " is not in a mesh of " + std::to_string(n) +
                                                   " vertices.");
  }
}

}  // namespace

Eigen::VectorXd Geodesics::distances(int source) const {
  check_vertex(source, impl_->n);
  Impl::Front front(*impl_);
  front.run(source, {});
  Eigen::VectorXd result(impl_->n);
  for (int v = 0; v < impl_->n; ++v) {
    result[v] = front.distance(v);
  }
  return result;
}

RowMatrix<double> Geodesics::between(const Eigen::VectorXi& sources, const RowMatrix<int>& targets,
                                     ProgressRange progress) const {
  if (sources.size() != targets.rows()) {
    throw Error(ErrorCode::wrong_shape, "There are " + std::to_string(sources.size()) +
                                            " sources for " + std::to_string(targets.rows()) +
                                            " rows of targets.");
  }
  for (const int v : sources) {
    check_vertex(v, impl_->n);
  }
  for (const int v : targets.reshaped()) {
    check_vertex(v, impl_->n);
  }
  std::vector<Eigen::Index> rows(static_cast<size_t>(sources.size()));
  std::iota(rows.begin(), rows.end(), Eigen::Index{0});
  std::stable_sort(rows.begin(), rows.end(),
                   [&](Eigen::Index a, Eigen::Index b) { return sources[a] < sources[b]; });
  std::vector<size_t> first;  // of the rows of each source
  for (size_t i = 0; i < rows.size(); ++i) {
    if (i == 0 || sources[rows[i]] != sources[rows[i - 1]]) {
      first.push_back(i);
    }
  }
  first.push_back(rows.size());
  RowMatrix<double> result(targets.rows(), targets.cols());
  const auto count = static_cast<Eigen::Index>(first.size()) - 1;
  std::atomic<Eigen::Index> done{0};
  std::atomic<bool> stop{false}, no_memory{false};
#pragma omp parallel
  {
    Impl::Front front(*impl_);
    std::vector<int> wanted;
#pragma omp for schedule(dynamic, 4)
    for (Eigen::Index s = 0; s < count; ++s) {
      if (stop) {
        continue;
      }
      try {
        const size_t begin = first[static_cast<size_t>(s)], end = first[static_cast<size_t>(s) + 1];
        wanted.clear();
        for (size_t i = begin; i < end; ++i) {
          const auto row = targets.row(rows[i]);
          wanted.insert(wanted.end(), row.begin(), row.end());
        }
        std::sort(wanted.begin(), wanted.end());
        wanted.erase(std::unique(wanted.begin(), wanted.end()), wanted.end());
        front.run(sources[rows[begin]], wanted);
        for (size_t i = begin; i < end; ++i) {
          for (Eigen::Index j = 0; j < targets.cols(); ++j) {
            result(rows[i], j) = front.distance(targets(rows[i], j));
          }
        }
        if (++done % kSourcesBetweenReports == 0) {
          progress.report(static_cast<double>(done) / static_cast<double>(count));
        }
      } catch (const std::bad_alloc&) {
        no_memory = stop = true;
      } catch (const Error&) {
        stop = true;
      }
    }
  }
  if (no_memory) {
    throw std::bad_alloc();
  }
  progress.report(1.0);
  return result;
}

}  // namespace supple
