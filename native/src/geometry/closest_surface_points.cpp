// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "supple/core/error.h"
#include "supple/geometry/mesh.h"
#include "supple/geometry/surface_map.h"

namespace supple {
namespace {

using Vector = Eigen::RowVector3d;

constexpr int kLeafFaces = 4;
// Twice the deepest tree that halving 2^31 faces makes.
constexpr size_t kStack = 64;
// Below this squared sine-like measure, which side of an edge a point is on is decided by rounding.
constexpr double kThin = 1e-8;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Triangle {
  Vector a, ab, ac, normal;  // normal of length 1
  double area_squared;       // |ab x ac|^2
  bool thin;
  int face;
};

struct Closest {
  double squared;
  Vector weights;
};

// The nearest point of the segment between two corners, if it is nearer.
void try_edge(const Vector& from, const Vector& along, const Vector& p, int c0, int c1,
              Closest& best) {
  const double length = along.squaredNorm();
  const double t = length > 0.0 ? std::clamp((p - from).dot(along) / length, 0.0, 1.0) : 0.0;
  const double squared = (p - from - t * along).squaredNorm();
  if (squared < best.squared) {
    best.squared = squared;
    best.weights.setZero();
    best.weights[c0] = 1.0 - t;
    best.weights[c1] = t;
  }
}

Closest closest_point(const Triangle& t, const Vector& p) {
  const Vector ap = p - t.a;
  const double height = ap.dot(t.normal);
  const double size = std::sqrt(t.area_squared);
  const double c = t.ab.cross(ap).dot(t.normal) / size;
  const double b = ap.cross(t.ac).dot(t.normal) / size;
  const double a = 1.0 - b - c;
  if (!t.thin && a >= 0.0 && b >= 0.0 && c >= 0.0) {
    return {height * height, {a, b, c}};
  }
  // Outside: the nearest point is on an edge that the point is on the outer side of.
  Closest best{kInfinity, Vector::Zero()};
  if (t.thin || c < 0.0) {
    try_edge(t.a, t.ab, p, 0, 1, best);
  }
  if (t.thin || b < 0.0) {
    try_edge(t.a, t.ac, p, 0, 2, best);
  }
  if (t.thin || a < 0.0) {
    try_edge(t.a + t.ab, t.ac - t.ab, p, 1, 2, best);
  }
  if (t.thin && a >= 0.0 && b >= 0.0 && c >= 0.0) {
    // Any weights give a point of the triangle; measured, it can't be too near.
    const double squared = (ap - b * t.ab - c * t.ac).squaredNorm();
    if (squared < best.squared) {
      best = {squared, {a, b, c}};
    }
  }
  return best;
}

struct Box {
  Vector low = Vector::Constant(kInfinity), high = Vector::Constant(-kInfinity);

  void add(const Vector& p) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  double squared_distance(const Vector& p) const {
    return (low - p).cwiseMax(p - high).cwiseMax(0.0).squaredNorm();
  }
  // The largest p . direction of a point p inside.
  double most_along(const Vector& direction) const {
    return low.cwiseProduct(direction).cwiseMax(high.cwiseProduct(direction)).sum();
  }
};

// A leaf's faces are [first, first + count); an inner node's children are the next node and
// `right`.
struct Node {
  Box box, normals;
  int first = 0, count = 0, right = 0;
};

struct Candidate {
  double squared;
  int triangle;
};

void check_finite(const Points& points, const char* what) {
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    if (!points.row(i).allFinite()) {
      throw Error(ErrorCode::not_finite, std::string(what) + " " + std::to_string(i) +
                                             " has a coordinate that is not a finite number.");
    }
  }
}

}  // namespace

struct ClosestSurfacePoints::Impl {
  Impl(const Points& vertices, const Faces& faces);

  // Those of order[from, to), below a new node.
  void build(const std::vector<Triangle>& all, const Points& centres, const std::vector<Box>& boxes,
             std::vector<int>& order, int from, int to);
  // All faces that may be the nearest and agree are left in `found`; what is there already bounds
  // the search. Returns the least squared distance.
  double search(const Vector& p, const Vector& normal, double cos_limit, double reach_squared,
                std::vector<Candidate>& found) const;
  // The lowest face of the nearest ones in `found`.
  int choose(double squared, const std::vector<Candidate>& found) const;
  double limit(double squared) const { return squared * (1.0 + 1e-9) + tie; }

  std::vector<Triangle> triangles;  // in the order of the leaves
  std::vector<Node> nodes;
  double tie = 0.0;  // squared distances this near to 0 are all 0
};

ClosestSurfacePoints::Impl::Impl(const Points& vertices, const Faces& faces) {
  check_finite(vertices, "Vertex");
  std::vector<Triangle> all;
  std::vector<Box> boxes;
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    if (faces.row(f).minCoeff() < 0 || faces.row(f).maxCoeff() >= vertices.rows()) {
      throw Error(ErrorCode::index_out_of_range,
                  "Face " + std::to_string(f) + " names a vertex that a mesh of " +
                      std::to_string(vertices.rows()) + " vertices does not have.");
    }
    if (is_degenerate(vertices, faces, f)) {
      continue;
    }
    const Vector a = vertices.row(faces(f, 0)), b = vertices.row(faces(f, 1)),
                 c = vertices.row(faces(f, 2));
    const Vector cross = (b - a).cross(c - a);
    const double longest =
        std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
    all.push_back({a, b - a, c - a, cross.normalized(), cross.squaredNorm(),
                   cross.squaredNorm() < kThin * longest * longest, static_cast<int>(f)});
    Box& box = boxes.emplace_back();
    box.add(a);
    box.add(b);
    box.add(c);
  }
  if (all.empty()) {
    throw Error(ErrorCode::empty_mesh,
                "None of the " + std::to_string(faces.rows()) +
                    " faces has an area, so there is no surface to find a point on.");
  }
  Points centres(static_cast<Eigen::Index>(all.size()), 3);
  for (size_t i = 0; i < all.size(); ++i) {
    centres.row(static_cast<Eigen::Index>(i)) = 0.5 * (boxes[i].low + boxes[i].high);
  }
  std::vector<int> order(all.size());
  std::iota(order.begin(), order.end(), 0);
  nodes.reserve(all.size());
  build(all, centres, boxes, order, 0, static_cast<int>(order.size()));
  triangles.reserve(all.size());
  for (const int i : order) {
    triangles.push_back(all[i]);
  }
  tie = 1e-18 * (nodes[0].box.high - nodes[0].box.low).squaredNorm();
}

void ClosestSurfacePoints::Impl::build(const std::vector<Triangle>& all, const Points& centres,
                                       const std::vector<Box>& boxes, std::vector<int>& order,
                                       int from, int to) {
  const size_t node = nodes.size();
  nodes.emplace_back();
  Box box, spread, normals;
  for (int i = from; i < to; ++i) {
    box.add(boxes[order[i]].low);
    box.add(boxes[order[i]].high);
    spread.add(centres.row(order[i]));
    normals.add(all[order[i]].normal);
  }
  nodes[node].box = box;
  nodes[node].normals = normals;
  if (to - from <= kLeafFaces) {
    nodes[node].first = from;
    nodes[node].count = to - from;
    return;
  }
  int axis = 0;
  (spread.high - spread.low).maxCoeff(&axis);
  const int middle = from + (to - from) / 2;
  std::nth_element(order.begin() + from, order.begin() + middle, order.begin() + to,
                   [&](int i, int j) {
                     return std::pair(centres(i, axis), i) < std::pair(centres(j, axis), j);
                   });
  build(all, centres, boxes, order, from, middle);
  nodes[node].right = static_cast<int>(nodes.size());
  build(all, centres, boxes, order, middle, to);
}

double ClosestSurfacePoints::Impl::search(const Vector& p, const Vector& normal, double cos_limit,
                                          double reach_squared,
                                          std::vector<Candidate>& found) const {
  double best = reach_squared;
  for (const Candidate& known : found) {
    best = std::min(best, known.squared);
  }
  const bool any_normal = normal.isZero(0.0);
  std::array<std::pair<double, int>, kStack> stack;
  size_t waiting = 0;
  stack[waiting++] = {nodes[0].box.squared_distance(p), 0};
  while (waiting > 0) {
    const auto [distance, index] = stack[--waiting];
    if (distance > limit(best)) {
      continue;
    }
    const Node& node = nodes[index];
    if (!any_normal && node.normals.most_along(normal) < cos_limit) {
      continue;
    }
    if (node.count > 0) {
      for (int i = node.first; i < node.first + node.count; ++i) {
        if (!any_normal && triangles[i].normal.dot(normal) < cos_limit) {
          continue;
        }
        const double squared = closest_point(triangles[i], p).squared;
        if (squared <= limit(best)) {
          found.push_back({squared, i});
          best = std::min(best, squared);
        }
      }
      continue;
    }
    std::pair<double, int> left{nodes[index + 1].box.squared_distance(p), index + 1};
    std::pair<double, int> right{nodes[node.right].box.squared_distance(p), node.right};
    if (left.first < right.first) {
      std::swap(left, right);
    }
    stack[waiting++] = left;
    stack[waiting++] = right;  // the nearer one is looked at first
  }
  return best;
}

int ClosestSurfacePoints::Impl::choose(double squared, const std::vector<Candidate>& found) const {
  int best = -1;
  for (const Candidate& candidate : found) {
    if (candidate.squared <= limit(squared) &&
        (best < 0 || triangles[candidate.triangle].face < triangles[best].face)) {
      best = candidate.triangle;
    }
  }
  return best;
}

ClosestSurfacePoints::ClosestSurfacePoints(const Points& vertices, const Faces& faces)
    : impl_(std::make_unique<const Impl>(vertices, faces)) {}
ClosestSurfacePoints::~ClosestSurfacePoints() = default;
ClosestSurfacePoints::ClosestSurfacePoints(ClosestSurfacePoints&&) noexcept = default;
ClosestSurfacePoints& ClosestSurfacePoints::operator=(ClosestSurfacePoints&&) noexcept = default;

ClosestSurfacePoints::Result ClosestSurfacePoints::query(const Points& points) const {
  Result result = query(points, Points::Zero(points.rows(), 3), -1.0);
  result.agrees.resize(0);
  return result;
}

ClosestSurfacePoints::Result ClosestSurfacePoints::query(const Points& points,
                                                         const Points& normals, double cos_limit,
                                                         double reach) const {
  if (normals.rows() != points.rows()) {
    throw Error(ErrorCode::wrong_shape, "There are " + std::to_string(normals.rows()) +
                                            " normals for " + std::to_string(points.rows()) +
                                            " points.");
  }
  if (!(cos_limit >= -1.0 && cos_limit <= 1.0) || !(reach >= 0.0)) {
    throw Error(ErrorCode::bad_option,
                "Normals agree from a cosine in [-1, 1] on, within a reach of at least 0; not " +
                    std::to_string(cos_limit) + " and " + std::to_string(reach) + ".");
  }
  check_finite(points, "Point");
  check_finite(normals, "Normal");
  const Eigen::Index count = points.rows();
  Result result{{Eigen::VectorXi(count), Points(count, 3)}, Eigen::VectorXd(count), {}};
  result.agrees.resize(count);
#pragma omp parallel
  {
    std::vector<Candidate> found;
    int former = -1;  // neighbours in memory are neighbours in space: it bounds the search
#pragma omp for schedule(dynamic, 256)
    for (Eigen::Index i = 0; i < count; ++i) {
      const Vector p = points.row(i);
      const auto look = [&](const Vector& normal, double limit) {
        found.clear();
        if (former >= 0 && limit == kInfinity &&
            (normal.isZero(0.0) || impl_->triangles[former].normal.dot(normal) >= cos_limit)) {
          found.push_back({closest_point(impl_->triangles[former], p).squared, former});
        }
        const double best = impl_->search(p, normal, cos_limit, limit * limit, found);
        return found.empty() ? -1 : impl_->choose(best, found);
      };
      int triangle = look(normals.row(i), reach);
      result.agrees[i] = triangle >= 0;
      if (triangle < 0) {
        triangle = look(Vector::Zero(), kInfinity);
      }
      former = triangle;
      const Closest closest = closest_point(impl_->triangles[triangle], p);
      result.map.face[i] = impl_->triangles[triangle].face;
      result.map.weights.row(i) = closest.weights;
      result.squared_distance[i] = closest.squared;
    }
  }
  return result;
}

}  // namespace supple
