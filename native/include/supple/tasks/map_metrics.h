// SPDX-License-Identifier: GPL-3.0-or-later
// Figures for a map from a source to a target mesh. map: one target vertex (0-based) for each of
// the ns source vertices. Each throws `wrong_shape` for a map of another length and
// `index_out_of_range` for a target that is not there. All but `geodesic_error`'s are cheap.
#pragma once

#include <vector>

#include "supple/core/progress.h"
#include "supple/core/types.h"
#include "supple/geometry/geodesics.h"
#include "supple/geometry/mesh.h"

namespace supple {

struct GeodesicError {
  double mean = 0.0;    ///< over the rows that are reached
  int unreachable = 0;  ///< rows whose two vertices no path joins
};

/// Mean length of the shortest path on the target between the image of A's point t and B's own,
/// over the square root of the target's area, times 100. images: points x maps, target vertices of
/// one map a column; truth: points, the target's own. One entry a column; the columns share the
/// work. geodesics: of the target, in units where its area is `area`.
/// Source: Kim et al. 2011, "Blended Intrinsic Maps"; the paper's Geod; paths: `Geodesics`, exact.
/// Errors: those of `Geodesics::between`.
std::vector<GeodesicError> geodesic_errors(const Geodesics& geodesics, double area,
                                           const Eigen::VectorXi& truth,
                                           const RowMatrix<int>& images,
                                           ProgressRange progress = {});

/// Percent of the source's faces whose image (its corners' targets) has a normal that points
/// against the sum of the target's vertex normals at those three targets. A face whose image has no
/// area is not one of them.
double face_inversion(const TriangleMesh& source, const TriangleMesh& target,
                      const Eigen::VectorXi& map);

/// Percent of the target's vertices j for which the sum of n1(i) . n2(j), over the i that map to j,
/// is negative; n1: vertex normals of the source's faces at the image, n2: the target's own.
/// Source: the paper, Eqn Inv.
double vertex_inversion(const TriangleMesh& source, const TriangleMesh& target,
                        const Eigen::VectorXi& map);

/// Dirichlet energy of the map, trace(V^T W V) with V the images in units where the target has area
/// 1 and W the source's Laplacian; 2 for the identity. Source: Magnet et al. 2022; the paper's
/// DirE.
double map_dirichlet(const TriangleMesh& source, const TriangleMesh& target,
                     const Eigen::VectorXi& map);

/// Percent of the target's vertex area (mass) that some source vertex maps to. Source: Ren et al.
/// 2018; the paper's Cov.
double coverage(const TriangleMesh& source, const TriangleMesh& target, const Eigen::VectorXi& map);

/// Mean distance of each point of `a` to the nearest of `b`, plus that of `b` to `a`, in the
/// points' units. Source: the paper's CD, which does not say whether it squares; here it does not.
/// Errors: `wrong_shape` where one has no point; `not_finite`.
double chamfer(const Points& a, const Points& b);

}  // namespace supple
