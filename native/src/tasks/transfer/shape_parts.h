// SPDX-License-Identifier: GPL-3.0-or-later
// What carrying shape keys is made of.
#pragma once

#include <memory>
#include <vector>

#include "supple/core/types.h"
#include "supple/geometry/mesh.h"
#include "supple/geometry/sparse_cholesky.h"
#include "supple/geometry/surface_map.h"
#include "supple/geometry/surface_operators.h"
#include "supple/tasks/mesh_view.h"

namespace supple {

/// p -> scale * p * rotation + offset.
struct Similarity {
  double scale = 1.0;
  Matrix3 rotation = Matrix3::Identity();
  Eigen::RowVector3d offset = Eigen::RowVector3d::Zero();

  Points operator()(const Points& p) const { return (scale * p * rotation).rowwise() + offset; }
};

/// The least mass-weighted |similarity(from) - to|^2, without mirroring. Source: Umeyama 1991.
Similarity fitted(const Points& from, const Points& to, const Eigen::VectorXd& mass);

/// The source's side: its deformation at its vertices.
class SourceShape {
 public:
  explicit SourceShape(const MeshView& view);
  /// n x 9, J - 1 of each vertex of n x 3 moved ones; 0 at vertices of no face with an area.
  MatrixField vertex_strains(const Points& moved) const;

  TriangleMesh mesh;

 private:
  Faces surface_faces_;
  MatrixField inverse_;
  SparseRowMatrix average_;
};

/// The map of a target's surface vertices; those without a partner have their nearest one's.
struct SurfacePartners {
  SurfaceMap map;
  std::vector<bool> known;
};
/// Errors: `bad_option` where no surface vertex has a partner.
SurfacePartners partners_of(const TriangleMesh& target, const SurfaceMap& map);

/// n x 9 rotations from the target's directions at each vertex to those of its partners (n x 3).
MatrixField frames_along(const SurfaceOperators& target, const Points& partners,
                         const std::shared_ptr<const SymbolicCholesky>& symbolic);

/// Where the source's vertices are on the target, for two meshes of one surface.
struct Anchors {
  Eigen::VectorXi vertex;  ///< source vertices that have a place
  SurfaceMap place;        ///< on the target's surface faces
  Points gap;              ///< from there to the source vertex
};
/// source: n x 3 vertices and faces in the target's surface units. partners: at target surface
/// vertices, in the same units. A vertex has a place where the map leads from there back to within
/// half of `edge`: so a map that leaves something out, or crosses to another sheet, anchors
/// nothing.
Anchors anchors_of(const Points& source, const Faces& source_faces, const SurfaceOperators& target,
                   const Points& partners, const std::vector<bool>& known, double edge);

/// The smoothest correction of a target's displacements that takes it through the source's: the
/// least |M^-1 W x|^2_M + weight |C x - what anchors miss|^2, factored once.
class AnchoredCorrection {
 public:
  AnchoredCorrection(const SurfaceOperators& target, Anchors anchors);
  /// What to add to `displacements` (of target surface vertices), so that anchors move by
  /// `offsets` (of source vertices), less what `strains` (J - 1 there) make of their gap.
  Points operator()(const Points& offsets, const MatrixField& strains,
                    const Points& displacements) const;

 private:
  Anchors anchors_;
  SparseMatrix interpolation_;  // C
  SparseCholesky factor_;
};

}  // namespace supple
