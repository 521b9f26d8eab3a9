// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <numeric>
#include <string>
#include <vector>

#include "supple/core/error.h"
#include "supple/geometry/operators.h"
#include "supple/tasks/transfer.h"
#include "tasks/transfer/islands.h"

namespace supple {
namespace {

// Normals agree within 80 degrees: a map may turn and shear, but not look the other way.
constexpr double kAgree = 0.17;
// How far an agreeing face may be from where the nearest one is, in mean edges.
constexpr double kReach = 3.0;

Faces rows_of(const Faces& faces, const std::vector<int>& kept) {
  Faces result(static_cast<Eigen::Index>(kept.size()), 3);
  for (Eigen::Index i = 0; i < result.rows(); ++i) {
    result.row(i) = faces.row(kept[i]);
  }
  return result;
}

// Which source island most of a target island's vertices are on.
struct Vote {
  int winner = -1;  // -1: none has more than half
  bool nearly_all = false;
};

Vote count_votes(const std::vector<int>& votes, double majority) {
  const auto most = std::max_element(votes.begin(), votes.end());
  const int all = std::accumulate(votes.begin(), votes.end(), 0);
  if (all == 0 || 2 * *most <= all) {
    return {};
  }
  return {static_cast<int>(most - votes.begin()), *most >= majority * all};
}

}  // namespace

Eigen::VectorXi islands_of(const Faces& faces, Eigen::Index n, int& count) {
  std::vector<int> parent(n);
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int i) {
    while (parent[i] != i) {
      i = parent[i] = parent[parent[i]];
    }
    return i;
  };
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    for (int c = 1; c < 3; ++c) {
      const int a = root(faces(f, 0)), b = root(faces(f, c));
      parent[std::max(a, b)] = std::min(a, b);
    }
  }
  Eigen::VectorXi label(n);
  count = 0;
  for (int i = 0; i < n; ++i) {
    const int r = root(i);  // never above i
    label[i] = r == i ? count++ : label[r];
  }
  return label;
}

void check_faces(const Faces& faces, Eigen::Index n, const char* which) {
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    if (faces.row(f).minCoeff() < 0 || faces.row(f).maxCoeff() >= n) {
      throw Error(ErrorCode::index_out_of_range, "Face " + std::to_string(f) + " of the " + which +
                                                     " names a vertex that its " +
                                                     std::to_string(n) + " vertices do not have.");
    }
  }
}

double mean_edge(const Points& vertices, const Faces& faces) {
  double sum = 0.0;
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    for (int c = 0; c < 3; ++c) {
      sum += (vertices.row(faces(f, c)) - vertices.row(faces(f, (c + 1) % 3))).norm();
    }
  }
  return sum / std::max<double>(1.0, 3.0 * static_cast<double>(faces.rows()));
}

int count_unmapped(const Eigen::VectorXi& face) {
  return static_cast<int>((face.array() < 0).count());
}

SurfaceMap reversed(const SurfaceMap& map, const MeshView& from, const MeshView& to) {
  check_faces(from.faces, from.vertices.rows(), "first mesh");
  check_faces(to.faces, to.vertices.rows(), "second mesh");
  check_surface_map(map, from.vertices.rows(), to.faces);
  const Points laid = apply(map, to.faces, to.vertices);
  std::vector<int> kept;
  for (int f = 0; f < from.faces.rows(); ++f) {
    if (map.face[from.faces(f, 0)] >= 0 && map.face[from.faces(f, 1)] >= 0 &&
        map.face[from.faces(f, 2)] >= 0) {
      kept.push_back(f);
    }
  }
  const Faces faces = rows_of(from.faces, kept);
  SurfaceMap result = ClosestSurfacePoints(laid, faces)
                          .query(to.vertices, vertex_normals(to.vertices, to.faces), kAgree,
                                 kReach * mean_edge(laid, faces))
                          .map;
  for (int& face : result.face) {
    face = kept[face];
  }
  return result;
}

IslandMap within_islands(const SurfaceMap& map, const MeshView& source, const Faces& target_faces,
                         double majority) {
  if (!(majority > 0.5 && majority <= 1.0)) {
    throw Error(ErrorCode::bad_option,
                "A majority is above 0.5 and at most 1, not " + std::to_string(majority) + ".");
  }
  check_faces(source.faces, source.vertices.rows(), "source");
  check_faces(target_faces, map.size(), "target");
  check_surface_map(map, map.size(), source.faces);
  int source_count = 0, target_count = 0;
  const Eigen::VectorXi source_island =
      islands_of(source.faces, source.vertices.rows(), source_count);
  const Eigen::VectorXi target_island = islands_of(target_faces, map.size(), target_count);
  const auto island_of_partner = [&](Eigen::Index i) {
    return source_island[source.faces(map.face[i], 0)];
  };

  std::vector<std::vector<int>> members(target_count);
  for (int i = 0; i < map.size(); ++i) {
    if (map.face[i] >= 0) {
      members[target_island[i]].push_back(i);
    }
  }
  std::vector<Vote> outcome(target_count);
  std::vector<bool> owned(source_count, false);
  std::vector<int> votes(source_count);
  IslandMap result{map, 0, 0};
  for (int island = 0; island < target_count; ++island) {
    std::fill(votes.begin(), votes.end(), 0);
    for (const int i : members[island]) {
      ++votes[island_of_partner(i)];
    }
    outcome[island] = count_votes(votes, majority);
    if (outcome[island].winner >= 0) {
      owned[outcome[island].winner] = true;
    }
  }
  std::vector<std::vector<int>> strays(source_count);  // by the source island they belong to
  for (int island = 0; island < target_count; ++island) {
    const Vote& vote = outcome[island];
    if (vote.winner < 0) {
      continue;
    }
    bool held = vote.nearly_all;
    for (const int i : members[island]) {
      const int on = island_of_partner(i);
      if (on != vote.winner && (vote.nearly_all || owned[on])) {
        strays[vote.winner].push_back(i);
        held = true;
      }
    }
    result.islands += held ? 1 : 0;
  }
  for (int island = 0; island < source_count; ++island) {
    const std::vector<int>& here = strays[island];
    if (here.empty()) {
      continue;
    }
    std::vector<int> kept;
    for (int f = 0; f < source.faces.rows(); ++f) {
      if (source_island[source.faces(f, 0)] == island) {
        kept.push_back(f);
      }
    }
    SurfaceMap stray{Eigen::VectorXi(here.size()), Points(here.size(), 3)};
    for (size_t i = 0; i < here.size(); ++i) {
      stray.face[i] = map.face[here[i]];
      stray.weights.row(i) = map.weights.row(here[i]);
    }
    const SurfaceMap found = ClosestSurfacePoints(source.vertices, rows_of(source.faces, kept))
                                 .query(apply(stray, source.faces, source.vertices))
                                 .map;
    for (size_t i = 0; i < here.size(); ++i) {
      result.map.face[here[i]] = kept[found.face[i]];
      result.map.weights.row(here[i]) = found.weights.row(i);
    }
    result.moved += static_cast<int>(here.size());
  }
  return result;
}

}  // namespace supple
