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
#include "supple/core/simd.h"
#include "supple/geometry/mesh.h"
#include "supple/geometry/surface_map.h"

namespace supple {
namespace {

using Vector = Eigen::RowVector3d;

constexpr int kLeafFaces = 4;
constexpr int kWide = 4;  // children of a node that are looked at together
// Three more wait at each level of the deepest tree that quartering 2^31 faces makes.
constexpr size_t kStack = 64;
// Boxes are compared in single precision: rounded outwards by so much of the largest coordinate,
// and what they find taken for so much less. Both are several roundings.
constexpr double kOutwards = 1e-6;
constexpr float kShorter = 1.0F - 1e-5F;
// Below this squared sine-like measure, which side of an edge a point is on is decided by rounding.
constexpr double kThin = 1e-8;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Triangle {
  Triangle(const Vector& a_in, const Vector& b, const Vector& c, int face_in)
      : a(a_in), ab(b - a_in), ac(c - a_in), face(face_in) {
    const Vector cross = ab.cross(ac);
    const double longest = std::max({ab.squaredNorm(), (ac - ab).squaredNorm(), ac.squaredNorm()});
    const double squared = cross.squaredNorm(), size = std::sqrt(squared);
    thin = squared < kThin * longest * longest;
    normal = cross / size;
    grad_b = ac.cross(normal) / size;
    grad_c = normal.cross(ab) / size;
  }

  Vector a, ab, ac, normal;  // normal of length 1
  Vector grad_b, grad_c;     // the second and third barycentric coordinates of p: (p - a) . grad
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
  const double b = ap.dot(t.grad_b), c = ap.dot(t.grad_c);
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
};

// A leaf's faces are order[first, first + count); an inner node's children are the next node and
// `right`.
struct HalvedNode {
  Box box, normals;
  int first = 0, count = 0, right = 0;
};

// Faces in a tree by halving. What Node is made from, four children at a time.
struct HalvedTree {
  HalvedTree(const std::vector<Triangle>& triangles, const std::vector<Box>& boxes)
      : order(triangles.size()), centres(static_cast<Eigen::Index>(triangles.size()), 3) {
    for (size_t i = 0; i < boxes.size(); ++i) {
      centres.row(static_cast<Eigen::Index>(i)) = 0.5 * (boxes[i].low + boxes[i].high);
    }
    std::iota(order.begin(), order.end(), 0);
    nodes.reserve(triangles.size());
    add(triangles, boxes, 0, static_cast<int>(order.size()));
  }

  // A node of order[from, to), and all below it.
  void add(const std::vector<Triangle>& triangles, const std::vector<Box>& boxes, int from,
           int to) {
    const size_t node = nodes.size();
    nodes.emplace_back();
    Box box, spread, normals;
    for (int i = from; i < to; ++i) {
      box.add(boxes[order[i]].low);
      box.add(boxes[order[i]].high);
      spread.add(centres.row(order[i]));
      normals.add(triangles[order[i]].normal);
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
    add(triangles, boxes, from, middle);
    nodes[node].right = static_cast<int>(nodes.size());
    add(triangles, boxes, middle, to);
  }

  // A leaf itself, or its two.
  std::vector<int> children_of(int index) const {
    const HalvedNode& node = nodes[static_cast<size_t>(index)];
    return node.count > 0 ? std::vector<int>{index} : std::vector<int>{index + 1, node.right};
  }

  std::vector<HalvedNode> nodes;
  std::vector<int> order;
  Points centres;
};

using Four = Lanes<float, 16>::type;

// Up to four children: node `first` where count is 0, faces [first, first + count) where it is
// more; none where it is less.
struct Node {
  Four low[3], high[3], normal_low[3], normal_high[3];
  std::array<int, kWide> first{}, count{-1, -1, -1, -1};

  // Of p to each child's box, squared: no more than it is.
  Four squared_distance(const Four (&p)[3]) const {
    Four sum{};
    for (int axis = 0; axis < 3; ++axis) {
      const Four below = low[axis] - p[axis], above = p[axis] - high[axis];
      Four away = below > above ? below : above;
      away = away > 0.0F ? away : Four{};
      sum += away * away;
    }
    return sum * kShorter;
  }
  // The largest cosine to a normal in each child: no less than it is.
  Four most_along(const Four (&normal)[3]) const {
    Four sum = Four{} + static_cast<float>(kOutwards);
    for (int axis = 0; axis < 3; ++axis) {
      const Four a = normal_low[axis] * normal[axis], b = normal_high[axis] * normal[axis];
      sum += a > b ? a : b;
    }
    return sum;
  }
};

// The same three numbers in all lanes.
void spread(const Vector& v, Four (&lanes)[3]) {
  for (int axis = 0; axis < 3; ++axis) {
    lanes[axis] = Four{} + static_cast<float>(v[axis]);
  }
}

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

  // Makes a node of a halved node's children's children. Returns its place.
  int widen(const HalvedTree& halved, int index, double outwards);
  // All faces that may be the nearest and agree are left in `found`; what is there already bounds
  // the search. Returns the least squared distance.
  double search(const Vector& p, const Vector& normal, double cos_limit, double reach_squared,
                std::vector<Candidate>& found) const;
  // The lowest face of the nearest ones in `found`.
  int choose(double squared, const std::vector<Candidate>& found) const;
  int triangle_near(int face) const {
    return face >= 0 && face < triangle_of.size() ? triangle_of[face] : -1;
  }
  double limit(double squared) const { return squared * (1.0 + 1e-9) + tie; }

  std::vector<Triangle> triangles;  // in the order of the leaves
  Eigen::VectorXi triangle_of;      // of each face; -1 without an area
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
    all.emplace_back(a, b, c, static_cast<int>(f));
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
  const HalvedTree halved(all, boxes);
  triangles.reserve(all.size());
  triangle_of = Eigen::VectorXi::Constant(faces.rows(), -1);
  for (const int i : halved.order) {
    triangle_of[all[i].face] = static_cast<int>(triangles.size());
    triangles.push_back(all[i]);
  }
  const Box& whole = halved.nodes[0].box;
  tie = 1e-18 * (whole.high - whole.low).squaredNorm();
  nodes.reserve(halved.nodes.size() / 2 + 1);
  widen(halved, 0,
        kOutwards * std::max(whole.low.cwiseAbs().maxCoeff(), whole.high.cwiseAbs().maxCoeff()));
}

int ClosestSurfacePoints::Impl::widen(const HalvedTree& halved, int index, double outwards) {
  std::vector<int> children;
  for (const int child : halved.children_of(index)) {
    const std::vector<int> below = halved.children_of(child);
    children.insert(children.end(), below.begin(), below.end());
  }
  const size_t place = nodes.size();
  nodes.emplace_back();
  for (size_t c = 0; c < children.size(); ++c) {
    const HalvedNode& child = halved.nodes[static_cast<size_t>(children[c])];
    for (int axis = 0; axis < 3; ++axis) {
      nodes[place].low[axis][c] = static_cast<float>(child.box.low[axis] - outwards);
      nodes[place].high[axis][c] = static_cast<float>(child.box.high[axis] + outwards);
      nodes[place].normal_low[axis][c] = static_cast<float>(child.normals.low[axis] - kOutwards);
      nodes[place].normal_high[axis][c] = static_cast<float>(child.normals.high[axis] + kOutwards);
    }
    const bool leaf = child.count > 0;
    const int first = leaf ? child.first : widen(halved, children[c], outwards);
    nodes[place].first[c] = first;
    nodes[place].count[c] = leaf ? child.count : 0;
  }
  return static_cast<int>(place);
}

double ClosestSurfacePoints::Impl::search(const Vector& p, const Vector& normal, double cos_limit,
                                          double reach_squared,
                                          std::vector<Candidate>& found) const {
  double best = reach_squared;
  for (const Candidate& known : found) {
    best = std::min(best, known.squared);
  }
  const bool any_normal = normal.isZero(0.0);
  Four place[3], direction[3];
  spread(p, place);
  spread(normal, direction);
  const auto look_at = [&](int i) {
    const Triangle& triangle = triangles[static_cast<size_t>(i)];
    if (!any_normal && triangle.normal.dot(normal) < cos_limit) {
      return;
    }
    const double height = (p - triangle.a).dot(triangle.normal);
    if (height * height > limit(best)) {
      return;
    }
    const double squared = closest_point(triangle, p).squared;
    if (squared <= limit(best)) {
      found.push_back({squared, i});
      best = std::min(best, squared);
    }
  };
  struct Waiting {
    float squared;
    int first, count;
  };
  std::array<Waiting, kStack> stack;
  size_t waiting = 0;
  stack[waiting++] = {0.0F, 0, 0};
  while (waiting > 0) {
    const Waiting now = stack[--waiting];
    if (now.squared > limit(best)) {
      continue;
    }
    if (now.count > 0) {
      for (int i = now.first; i < now.first + now.count; ++i) {
        look_at(i);
      }
      continue;
    }
    const Node& node = nodes[static_cast<size_t>(now.first)];
    const Four squared = node.squared_distance(place), along = node.most_along(direction);
    const size_t bottom = waiting;
    for (int c = 0; c < kWide; ++c) {
      if (node.count[c] < 0 || squared[c] > limit(best) || (!any_normal && along[c] < cos_limit)) {
        continue;
      }
      size_t at = waiting++;  // the nearest on top: it is looked at first
      for (; at > bottom && stack[at - 1].squared < squared[c]; --at) {
        stack[at] = stack[at - 1];
      }
      stack[at] = {squared[c], node.first[c], node.count[c]};
    }
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
                                                         double reach,
                                                         const Eigen::VectorXi& near) const {
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
  if (near.size() != 0 && near.size() != points.rows()) {
    throw Error(ErrorCode::wrong_shape, "There are " + std::to_string(near.size()) +
                                            " faces to start from for " +
                                            std::to_string(points.rows()) + " points.");
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
      const int start = near.size() > 0 ? impl_->triangle_near(near[i]) : former;
      const auto look = [&](const Vector& normal, double limit) {
        found.clear();
        if (start >= 0 &&
            (normal.isZero(0.0) || impl_->triangles[start].normal.dot(normal) >= cos_limit)) {
          const double squared = closest_point(impl_->triangles[start], p).squared;
          if (squared <= limit * limit) {
            found.push_back({squared, start});
          }
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
