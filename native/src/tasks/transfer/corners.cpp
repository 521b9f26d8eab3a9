// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "supple/core/error.h"
#include "supple/geometry/mesh.h"
#include "supple/tasks/transfer.h"
#include "tasks/transfer/islands.h"

namespace supple {
namespace {

using Vector = Eigen::RowVector3d;

// A target face's centre looks for a source face within 80 degrees of its partners' triangle.
constexpr double kAgree = 0.17;
// A point this near to a face is on it; squared, as a part of the target face's radius.
constexpr double kOnFace = 1e-16;

void check_corners(const RowMatrix<double>& corners, const Faces& faces,
                   const CornerOptions& options) {
  if (corners.rows() != 3 * faces.rows()) {
    throw Error(ErrorCode::wrong_shape, "There are values for " + std::to_string(corners.rows()) +
                                            " corners; the source has " +
                                            std::to_string(3 * faces.rows()) + ", three a face.");
  }
  for (Eigen::Index i = 0; i < corners.rows(); ++i) {
    if (!corners.row(i).allFinite()) {
      throw Error(ErrorCode::not_finite, "Corner " + std::to_string(i % 3) + " of face " +
                                             std::to_string(i / 3) +
                                             " of the source has a value that is not a finite "
                                             "number.");
    }
  }
  if (!(options.tolerance >= 0.0)) {
    throw Error(ErrorCode::bad_option, "The tolerance of a seam can't be below 0.");
  }
}

// The faces beside each face over edges at which the values go on.
class Continuations {
 public:
  Continuations(const Faces& faces, const RowMatrix<double>& corners, double tolerance) {
    struct Side {
      int low, high, face;
      Eigen::Index at_low, at_high;  // rows of `corners`
    };
    std::vector<Side> sides;
    sides.reserve(3 * static_cast<size_t>(faces.rows()));
    for (int f = 0; f < faces.rows(); ++f) {
      for (int c = 0; c < 3; ++c) {
        const int d = (c + 1) % 3, a = faces(f, c), b = faces(f, d);
        const Eigen::Index first = 3 * Eigen::Index{f};
        if (a < b) {
          sides.push_back({a, b, f, first + c, first + d});
        } else if (b < a) {
          sides.push_back({b, a, f, first + d, first + c});
        }
      }
    }
    std::sort(sides.begin(), sides.end(), [](const Side& x, const Side& y) {
      return std::array{x.low, x.high, x.face} < std::array{y.low, y.high, y.face};
    });
    const double range = corners.size() > 0 ? corners.maxCoeff() - corners.minCoeff() : 0.0;
    const auto same = [&](Eigen::Index i, Eigen::Index j) {
      return (corners.row(i) - corners.row(j)).cwiseAbs().maxCoeff() <= tolerance * range;
    };
    std::vector<std::array<int, 2>> pairs;
    for (size_t i = 0; i < sides.size(); ++i) {
      for (size_t j = i + 1;
           j < sides.size() && sides[j].low == sides[i].low && sides[j].high == sides[i].high;
           ++j) {
        if (same(sides[i].at_low, sides[j].at_low) && same(sides[i].at_high, sides[j].at_high)) {
          pairs.push_back({sides[i].face, sides[j].face});
          pairs.push_back({sides[j].face, sides[i].face});
        }
      }
    }
    std::sort(pairs.begin(), pairs.end());
    first_.assign(faces.rows() + 1, 0);
    for (const auto& pair : pairs) {
      ++first_[pair[0] + 1];
      beside_.push_back(pair[1]);
    }
    for (size_t f = 1; f < first_.size(); ++f) {
      first_[f] += first_[f - 1];
    }
  }

  const int* begin(int face) const { return beside_.data() + first_[face]; }
  const int* end(int face) const { return beside_.data() + first_[face + 1]; }

 private:
  std::vector<int> first_, beside_;
};

// The nearest point of one triangle, and where a point of its plane is in its corners' terms.
struct Place {
  double squared;
  Vector nearest, plane;
};

Vector on_edge(const Vector& from, const Vector& to, const Vector& p, double& t) {
  const double length = (to - from).squaredNorm();
  t = length > 0.0 ? std::clamp((p - from).dot(to - from) / length, 0.0, 1.0) : 0.0;
  return from + t * (to - from);
}

Place place_in(const Points& v, const Faces& faces, int f, const Vector& p) {
  const std::array<Vector, 3> corner{v.row(faces(f, 0)), v.row(faces(f, 1)), v.row(faces(f, 2))};
  Place place{std::numeric_limits<double>::infinity(), Vector::Zero(), Vector::Zero()};
  for (int c = 0; c < 3; ++c) {
    const int d = (c + 1) % 3;
    double t = 0.0;
    const double squared = (on_edge(corner[c], corner[d], p, t) - p).squaredNorm();
    if (squared < place.squared) {
      place.squared = squared;
      place.nearest.setZero();
      place.nearest[c] = 1.0 - t;
      place.nearest[d] = t;
    }
  }
  place.plane = place.nearest;
  if (!is_degenerate(v, faces, f)) {
    const Vector normal = (corner[1] - corner[0]).cross(corner[2] - corner[0]);
    const double area = normal.squaredNorm();
    for (int c = 0; c < 3; ++c) {
      const Vector& a = corner[(c + 1) % 3];
      place.plane[c] = (corner[(c + 2) % 3] - a).cross(p - a).dot(normal) / area;
    }
    if (place.plane.minCoeff() >= 0.0) {
      const double height = (p - corner[0]).dot(normal);
      place.squared = height * height / area;
      place.nearest = place.plane;
    }
  }
  return place;
}

// Everything of a source that its corners' values are looked up with.
struct Source {
  const MeshView& mesh;
  const Continuations& continuations;
  const RowMatrix<double>& corners;
  bool extrapolate;
};

// The source faces reached from one without crossing a seam, within a ball. One for each thread.
class Region {
 public:
  explicit Region(const Source& source)
      : source_(source), reached_at_(source.mesh.faces.rows(), -1) {}

  void grow(int start, const Vector& centre, double radius_squared) {
    ++round_;
    on_face_ = kOnFace * radius_squared;
    faces_.assign(1, start);
    reached_at_[start] = round_;
    for (size_t i = 0; i < faces_.size(); ++i) {
      const int here = faces_[i];
      for (const int* f = source_.continuations.begin(here); f != source_.continuations.end(here);
           ++f) {
        if (reached_at_[*f] != round_ &&
            place_in(source_.mesh.vertices, source_.mesh.faces, *f, centre).squared <=
                radius_squared) {
          reached_at_[*f] = round_;
          faces_.push_back(*f);
        }
      }
    }
  }
  bool has(int face) const { return reached_at_[face] == round_; }

  // The value at a point of the surface, on this side of every seam.
  Eigen::RowVectorXd value(int face, const Vector& weights, const Vector& point) const {
    // Where seams meet in a vertex, as at the pole of a globe, several faces of the region have the
    // point, each with a value of its own: the one that the search began at comes first.
    Place best = place_in(source_.mesh.vertices, source_.mesh.faces, faces_[0], point);
    if (best.squared <= on_face_) {
      return at(faces_[0], best.nearest);
    }
    if (has(face)) {
      return at(face, weights);
    }
    int nearest = faces_[0];
    for (const int f : faces_) {
      const Place place = place_in(source_.mesh.vertices, source_.mesh.faces, f, point);
      if (place.squared < best.squared || (place.squared == best.squared && f < nearest)) {
        best = place;
        nearest = f;
      }
    }
    return at(nearest, source_.extrapolate ? best.plane : best.nearest);
  }

 private:
  Eigen::RowVectorXd at(int face, const Vector& weights) const {
    return weights * source_.corners.middleRows(3 * Eigen::Index{face}, 3);
  }

  const Source& source_;
  std::vector<int> reached_at_, faces_;
  double on_face_ = 0.0;
  int round_ = -1;
};

// Target faces that stay on one side of every seam together: the triangles of a polygon.
using Polygons = std::vector<std::vector<int>>;

Polygons polygons_of(const Eigen::VectorXi& labels, Eigen::Index faces) {
  if (labels.size() != 0 && labels.size() != faces) {
    throw Error(ErrorCode::wrong_shape, "There are polygons for " + std::to_string(labels.size()) +
                                            " faces; the target has " + std::to_string(faces) +
                                            ".");
  }
  std::vector<int> order(faces);
  std::iota(order.begin(), order.end(), 0);
  const auto label = [&](int f) { return labels.size() == 0 ? f : labels[f]; };
  std::stable_sort(order.begin(), order.end(), [&](int f, int g) { return label(f) < label(g); });
  Polygons result;
  for (size_t i = 0; i < order.size(); ++i) {
    if (i == 0 || label(order[i]) != label(order[i - 1])) {
      result.emplace_back();
    }
    result.back().push_back(order[i]);
  }
  return result;
}

// Where the search for each polygon's side of the seams begins.
struct Centres {
  Points points;
  Eigen::VectorXi face;
  Eigen::VectorXd radius_squared;
};

// On which side of a thin source a target face lies, its triangle of partners says: unless the map
// is a mirror image, which most of them together say.
Centres centres_of(const SurfaceMap& map, const MeshView& source, const Faces& target_faces,
                   const Polygons& polygons, const Points& partners) {
  const auto count = static_cast<Eigen::Index>(polygons.size());
  Centres centres{Points::Zero(count, 3), {}, Eigen::VectorXd::Zero(count)};
  Points facing = Points::Zero(count, 3);
  for (Eigen::Index p = 0; p < count; ++p) {
    int mapped = 0;
    for (const int f : polygons[p]) {
      int of_face = 0;
      for (const int v : target_faces.row(f)) {
        if (map.face[v] >= 0) {
          centres.points.row(p) += partners.row(v);
          ++of_face;
        }
      }
      mapped += of_face;
      if (of_face == 3) {
        const Vector a = partners.row(target_faces(f, 0));
        facing.row(p) += (partners.row(target_faces(f, 1)) - a)
                             .cross(Vector(partners.row(target_faces(f, 2)) - a));
      }
    }
    centres.points.row(p) /= std::max(1, mapped);
    for (const int f : polygons[p]) {
      for (const int v : target_faces.row(f)) {
        if (map.face[v] >= 0) {
          const Vector out = partners.row(v) - centres.points.row(p);
          centres.radius_squared[p] = std::max(centres.radius_squared[p], out.squaredNorm());
        }
      }
    }
  }
  const ClosestSurfacePoints surface(source.vertices, source.faces);
  const auto nearest = surface.query(centres.points);
  const Points normals = face_normals(source.vertices, source.faces);
  double same = 0.0;
  for (Eigen::Index p = 0; p < count; ++p) {
    same += facing.row(p).dot(normals.row(nearest.map.face[p]));
  }
  for (Eigen::Index p = 0; p < count; ++p) {
    const double length = facing.row(p).norm();
    facing.row(p) *= length > 0.0 ? (same < 0.0 ? -1.0 : 1.0) / length : 0.0;
  }
  const auto agreeing = surface.query(centres.points, facing, kAgree);
  centres.face = nearest.map.face;
  for (Eigen::Index p = 0; p < count; ++p) {
    if (agreeing.squared_distance[p] <= centres.radius_squared[p]) {
      centres.face[p] = agreeing.map.face[p];
    }
  }
  return centres;
}

}  // namespace

TransferredField transfer_corners(const SurfaceMap& map, const MeshView& source,
                                  const Faces& target_faces, const RowMatrix<double>& corners,
                                  const CornerOptions& options, double otherwise) {
  check_faces(source.faces, source.vertices.rows(), "source");
  check_faces(target_faces, map.size(), "target");
  check_corners(corners, source.faces, options);
  const Points partners = apply(map, source.faces, source.vertices);
  const Polygons polygons = polygons_of(options.polygons, target_faces.rows());
  const Centres centres = centres_of(map, source, target_faces, polygons, partners);
  const Continuations continuations(source.faces, corners, options.tolerance);
  const Source side{source, continuations, corners, options.extrapolate};
  TransferredField result{RowMatrix<double>(3 * target_faces.rows(), corners.cols()),
                          count_unmapped(map.face)};
#pragma omp parallel
  {
    Region region(side);
#pragma omp for schedule(dynamic, 64)
    for (Eigen::Index p = 0; p < centres.face.size(); ++p) {
      region.grow(centres.face[p], centres.points.row(p), centres.radius_squared[p]);
      for (const int f : polygons[p]) {
        for (int c = 0; c < 3; ++c) {
          const int v = target_faces(f, c);
          const Eigen::Index row = 3 * Eigen::Index{f} + c;
          if (map.face[v] < 0) {
            result.values.row(row).setConstant(otherwise);
          } else {
            result.values.row(row) = region.value(map.face[v], map.weights.row(v), partners.row(v));
          }
        }
      }
    }
  }
  return result;
}

}  // namespace supple
