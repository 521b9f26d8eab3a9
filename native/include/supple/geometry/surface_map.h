// SPDX-License-Identifier: GPL-3.0-or-later
// Maps to points inside triangles. "Source" is what is mapped, "target" the mesh it is mapped to.
#pragma once

#include <limits>
#include <memory>

#include "supple/core/types.h"

namespace supple {

/// A point on the target for each of n source points, as a target face and barycentric weights of
/// its corners. Target functions are pulled back along it (`apply`): it carries what lives on the
/// target to the source.
struct SurfaceMap {
  Eigen::VectorXi face;  ///< n, in [0, target faces), or -1 where a source point has no partner
  Points weights;        ///< n x 3, >= 0, each row sums to 1; ignored (and 0) where face is -1

  Eigen::Index size() const { return face.size(); }
};

/// Throws where `map` is none of `size` source points to these faces. Errors: `wrong_shape`;
/// `index_out_of_range` for a face outside [-1, m); `not_finite`; `bad_option` for weights below
/// -1e-9 or whose sum is not 1 to 1e-6.
void check_surface_map(const SurfaceMap& map, Eigen::Index size, const Faces& target_faces);

/// Each source point at a corner of the lowest target face that has its target vertex, one with
/// three different corners where there is one. point_map: n, a target vertex or -1. -1 where there
/// is no vertex or no face has it. Errors: `index_out_of_range`.
SurfaceMap surface_map(const Eigen::VectorXi& point_map, const Faces& target_faces,
                       Eigen::Index target_vertices);

/// n: the corner with the largest weight (of equal ones the lowest vertex) of each source point's
/// face; -1 where it has none. Errors: those of `check_surface_map`.
Eigen::VectorXi nearest_corners(const SurfaceMap& map, const Faces& target_faces);

/// n x c: a target field (one row a target vertex) at each source point, `otherwise` where it has
/// no partner. Field: row-major, of any columns. Errors: those of `check_surface_map`;
/// `index_out_of_range` for a face's corner beyond the field.
template <int Columns>
Eigen::Matrix<double, Eigen::Dynamic, Columns, Eigen::RowMajor> apply(
    const SurfaceMap& map, const Faces& target_faces,
    const Eigen::Matrix<double, Eigen::Dynamic, Columns, Eigen::RowMajor>& field,
    double otherwise = 0.0);

/// The nearest points of a surface: a tree of bounding boxes over its faces, exact distances to
/// triangles. Faces without area (`is_degenerate`) are left out. Copies what it needs; immutable;
/// safe to use from several threads. Source: Ericson 2004, "Real-Time Collision Detection", 5.1.5.
class ClosestSurfacePoints {
 public:
  /// vertices: t x 3, finite; faces: m x 3. Errors: `wrong_shape`, `index_out_of_range`,
  /// `not_finite`; `empty_mesh` where no face has an area.
  ClosestSurfacePoints(const Points& vertices, const Faces& faces);
  ~ClosestSurfacePoints();
  ClosestSurfacePoints(ClosestSurfacePoints&&) noexcept;
  ClosestSurfacePoints& operator=(ClosestSurfacePoints&&) noexcept;

  struct Result {
    SurfaceMap map;  ///< every query has a face: of those equally near (to 1e-9) the lowest
    Eigen::VectorXd squared_distance;  ///< q
    /// q: whether the face's normal agrees; empty where none were given.
    Eigen::Array<bool, Eigen::Dynamic, 1> agrees;
  };
  /// points: q x 3. Errors: `not_finite`.
  Result query(const Points& points) const;
  /// The nearest point among faces whose unit normal n has n . normal >= cos_limit, within `reach`
  /// (in the points' units); where there is none, the nearest of all, with `agrees` false. normals:
  /// q x 3, of length 1, or 0 to agree with every face. near: q faces where the search starts, or
  /// none: the answer is the same, sooner where they are near. Errors: `wrong_shape`, `not_finite`,
  /// `bad_option` for a cos_limit outside [-1, 1] or a reach below 0.
  Result query(const Points& points, const Points& normals, double cos_limit,
               double reach = std::numeric_limits<double>::infinity(),
               const Eigen::VectorXi& near = {}) const;

 private:
  struct Impl;
  std::unique_ptr<const Impl> impl_;
};

// ------------------------------------------------------------------------------------------------

/// What `apply` checks: the map, and that every corner of a used face is a row of the field.
void check_pull_back(const SurfaceMap& map, const Faces& target_faces, Eigen::Index field_rows);

template <int Columns>
Eigen::Matrix<double, Eigen::Dynamic, Columns, Eigen::RowMajor> apply(
    const SurfaceMap& map, const Faces& target_faces,
    const Eigen::Matrix<double, Eigen::Dynamic, Columns, Eigen::RowMajor>& field,
    double otherwise) {
  check_pull_back(map, target_faces, field.rows());
  Eigen::Matrix<double, Eigen::Dynamic, Columns, Eigen::RowMajor> result(map.size(), field.cols());
#pragma omp parallel for schedule(static)
  for (Eigen::Index i = 0; i < map.size(); ++i) {
    const int f = map.face[i];
    if (f < 0) {
      result.row(i).setConstant(otherwise);
    } else {
      result.row(i) = map.weights(i, 0) * field.row(target_faces(f, 0)) +
                      map.weights(i, 1) * field.row(target_faces(f, 1)) +
                      map.weights(i, 2) * field.row(target_faces(f, 2));
    }
  }
  return result;
}

}  // namespace supple
