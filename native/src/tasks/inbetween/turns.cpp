// SPDX-License-Identifier: GPL-3.0-or-later
#include "turns.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <queue>
#include <tuple>
#include <utility>

#include "supple/geometry/jacobians.h"
#include "supple/geometry/mesh.h"
#include "supple/geometry/rotations.h"

namespace supple {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;

// Calls visit(g) for each face g that shares an edge with f.
void for_each_neighbour(const SurfaceOperators& operators, int f, const auto& visit) {
  const CornerTable& corners = operators.corners;
  for (int c = 0; c < 3; ++c) {
    const int from = operators.faces(f, c), to = operators.faces(f, (c + 1) % 3);
    for (int i = corners.first[from]; i < corners.first[from + 1]; ++i) {
      const int g = corners.corner[i] / 3;
      if (g != f && (operators.faces.row(g).array() == to).any()) {
        visit(g);
      }
    }
  }
}

// A face and the one it was reached from.
struct Visit {
  int face, from;
};

// The faces that edges connect with a seed. The most alike are crossed first, so that a bad face (a
// fold, a sliver) does not decide for those behind it.
std::vector<Visit> walk(const SurfaceOperators& operators, const MatrixField& turns, int seed,
                        std::vector<bool>& reached) {
  using Entry = std::tuple<double, int, int>;  // unlikeness, face, from
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  std::vector<Visit> visits;
  open.emplace(0.0, seed, -1);
  while (!open.empty()) {
    const auto [unlikeness, face, from] = open.top();
    open.pop();
    if (reached[static_cast<size_t>(face)]) {
      continue;
    }
    reached[static_cast<size_t>(face)] = true;
    visits.push_back({face, from});
    for_each_neighbour(operators, face, [&](int other) {
      if (!reached[static_cast<size_t>(other)]) {
        open.emplace(-turns.row(face).dot(turns.row(other)), other, face);
      }
    });
  }
  return visits;
}

// Spreads the seed's vector along a walk; the area-weighted sum of the angles.
double spread(const std::vector<Visit>& visits, const Points& principal,
              const Eigen::RowVector3d& seed, const Eigen::VectorXd& areas, Points& vectors) {
  double sum = 0.0;
  for (const auto& [face, from] : visits) {
    vectors.row(face) = from < 0 ? seed : nearest_turn(principal.row(face), vectors.row(from));
    sum += areas[face] * vectors.row(face).norm();
  }
  return sum;
}

// The branch whose mean angle is least: whole turns are added while that makes it less.
void spread_shortest(const std::vector<Visit>& visits, const Points& principal,
                     const Eigen::VectorXd& areas, Points& vectors) {
  Eigen::RowVector3d best = principal.row(visits.front().face);
  const Eigen::RowVector3d axis =
      best.norm() > 0.0 ? Eigen::RowVector3d(best.normalized()) : Eigen::RowVector3d::UnitX();
  double least = spread(visits, principal, best, areas, vectors);
  const Eigen::RowVector3d start = best;
  for (const double direction : {kTurn, -kTurn}) {
    Eigen::RowVector3d next = start + direction * axis;
    // A tie is two ways of the same length: the first is kept, whatever rounding says.
    for (double sum; (sum = spread(visits, principal, next, areas, vectors)) < least * (1.0 - 1e-9);
         next += direction * axis) {
      least = sum;
      best = next;
    }
  }
  spread(visits, principal, best, areas, vectors);
}

}  // namespace

MatrixField pose_rotations(const SurfaceOperators& operators, const Points& moved,
                           const MatrixField& jacobians) {
  MatrixField rotations = closest_rotations(jacobians);
  std::vector<int> open;
  std::vector<bool> known(static_cast<size_t>(rotations.rows()), true);
  for (int f = 0; f < rotations.rows(); ++f) {
    if (is_degenerate(moved, operators.faces, f)) {
      known[static_cast<size_t>(f)] = false;
      open.push_back(f);
    }
  }
  // From the rim inwards, all of a ring at once: no order of the faces shows.
  for (size_t before = open.size() + 1; !open.empty() && open.size() < before;) {
    before = open.size();
    std::vector<std::pair<int, Matrix3>> found;
    for (const int f : open) {
      Matrix3 sum = Matrix3::Zero();
      bool any = false;
      for_each_neighbour(operators, f, [&](int g) {
        if (known[static_cast<size_t>(g)]) {
          sum += matrix_at(std::as_const(rotations), g);
          any = true;
        }
      });
      if (any) {
        found.emplace_back(f, closest_rotation(sum));
      }
    }
    for (const auto& [f, rotation] : found) {
      matrix_at(rotations, f) = rotation;
      known[static_cast<size_t>(f)] = true;
    }
    std::erase_if(open, [&](int f) { return known[static_cast<size_t>(f)]; });
  }
  return rotations;
}

Eigen::RowVector3d nearest_turn(const Eigen::RowVector3d& vector, const Eigen::RowVector3d& other) {
  const double angle = vector.norm();
  if (angle < 1e-12) {  // any axis does
    const double whole = kTurn * std::round(other.norm() / kTurn);
    return whole > 0.0 ? Eigen::RowVector3d(whole * other.normalized()) : vector;
  }
  const Eigen::RowVector3d axis = vector / angle;
  return (angle + kTurn * std::round((other.dot(axis) - angle) / kTurn)) * axis;
}

Points turns_between(const SurfaceOperators& operators, const MatrixField& from,
                     const MatrixField& to, const std::vector<int>& guides) {
  const Eigen::Index m = from.rows();
  MatrixField turns(m, 9);
  Points principal(m, 3);
#pragma omp parallel for schedule(static)
  for (Eigen::Index f = 0; f < m; ++f) {
    const Matrix3 turn = matrix_at(from, f).transpose() * matrix_at(to, f);
    matrix_at(turns, f) = turn;
    principal.row(f) = rotation_vector(turn);
  }
  const auto guide_of = [&](int face) {
    return guides[static_cast<size_t>(operators.component[operators.faces(face, 0)])];
  };
  std::vector<int> order(static_cast<size_t>(m));
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return std::pair(guide_of(a) >= 0, -operators.face_areas[a]) <
           std::pair(guide_of(b) >= 0, -operators.face_areas[b]);
  });
  Points vectors(m, 3);
  std::vector<bool> reached(static_cast<size_t>(m), false);
  for (const int seed : order) {
    if (reached[static_cast<size_t>(seed)]) {
      continue;
    }
    const std::vector<Visit> visits = walk(operators, turns, seed, reached);
    if (const int guide = guide_of(seed); guide >= 0) {
      spread(visits, principal, nearest_turn(principal.row(seed), vectors.row(guide)),
             operators.face_areas, vectors);
    } else {
      spread_shortest(visits, principal, operators.face_areas, vectors);
    }
  }
  return vectors;
}

}  // namespace supple
