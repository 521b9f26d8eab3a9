// SPDX-License-Identifier: GPL-3.0-or-later
// What lives on one mesh, carried to another. The "source" has it, the "target" gets it; every map
// here goes from target vertices to the source's surface (`SurfaceMap` whose size is that of the
// target, whose faces are the source's), unless it says otherwise. `reversed` makes it of the other
// direction. A target vertex that the map gives no partner (-1) is counted in `unmapped`.
#pragma once

#include <vector>

#include "supple/core/progress.h"
#include "supple/core/types.h"
#include "supple/geometry/surface_map.h"
#include "supple/tasks/mesh_view.h"

namespace supple {

// --- maps ---------------------------------------------------------------------------------------

/// The map of `to`'s vertices to `from`'s surface, of one from `from`'s vertices to `to`'s surface:
/// `from`'s faces are laid where their corners go, and each vertex of `to` takes the nearest point
/// of them, first among those that face the same way. Faces with an unmapped corner are left out.
/// Errors: those of `check_surface_map` and `ClosestSurfacePoints`.
SurfaceMap reversed(const SurfaceMap& map, const MeshView& from, const MeshView& to);

struct IslandMap {
  SurfaceMap map;
  int islands = 0;  ///< target islands that were held to one source island
  int moved = 0;    ///< target vertices whose partner was on another
};
/// A map along which nothing bleeds between islands (connected components by faces). The source
/// island with most of a target island's vertices, if more than half, is that island's own.
/// Vertices elsewhere move to the point of it nearest to their partner, where the island they were
/// on is another target island's own, or where at least `majority` of theirs is on their own. So a
/// single skin over parts that nothing else covers keeps them all. majority: in (0.5, 1]. Errors:
/// those of `check_surface_map`; `bad_option`.
IslandMap within_islands(const SurfaceMap& map, const MeshView& source, const Faces& target_faces,
                         double majority = 0.95);

// --- fields -------------------------------------------------------------------------------------

struct TransferredField {
  RowMatrix<double> values;  ///< a row for each target vertex or corner
  int unmapped = 0;
};

/// Source vertex values (n x c) at the target's vertices: barycentric. `otherwise` where unmapped.
/// Errors: those of `apply`.
TransferredField transfer_field(const SurfaceMap& map, const Faces& source_faces,
                                const RowMatrix<double>& field, double otherwise = 0.0);

struct GroupOptions {
  double smallest = 1e-4;  ///< weights below become 0; in [0, 1)
  double majority = 0.95;  ///< of `within_islands`
};
struct TransferredGroups {
  RowMatrix<double> weights;  ///< target vertices x groups
  bool normalised = false;    ///< whether the source's rows summed to 1, so that the target's do
  int unmapped = 0;           ///< their weights are all 0
  int moved = 0;              ///< of `within_islands`
};
/// Vertex groups: n x g weights >= 0, 0 for "not in the group". Columns are groups and stay in
/// their order, whatever their names. Where every source row that is not 0 sums to 1 (to 1e-4), so
/// do the target's. Errors: those of `within_islands`; `wrong_shape`, `not_finite`, `bad_option`.
TransferredGroups transfer_groups(const SurfaceMap& map, const MeshView& source,
                                  const Faces& target_faces, const RowMatrix<double>& weights,
                                  const GroupOptions& options = {});

struct CornerOptions {
  /// Values at an edge that differ by more than this times the range of all are a seam.
  double tolerance = 1e-6;
  /// Over a seam: true continues the values linearly (UVs), false takes the nearest (colours).
  bool extrapolate = true;
};
/// Values at face corners (source 3 m x c, row 3 f + k is corner k of face f; the target's
/// likewise): UVs, colours by corner. Each target face takes all its corners from one side of every
/// seam: the source faces that are reached from its centre without crossing one, and no farther
/// from it than its corners; so it spans neither two charts nor a chart's two ends. `otherwise` at
/// unmapped corners; `unmapped` counts vertices. Errors: those of `check_surface_map`;
/// `wrong_shape`, `not_finite`, `bad_option`.
TransferredField transfer_corners(const SurfaceMap& map, const MeshView& source,
                                  const Faces& target_faces, const RowMatrix<double>& corners,
                                  const CornerOptions& options = {}, double otherwise = 0.0);

// --- shapes -------------------------------------------------------------------------------------

struct TransferredShapes {
  std::vector<Points> shapes;  ///< target vertices, in the target's units
  /// Whether the two rest shapes are one surface (as they lie or after a similarity) to within the
  /// source's mean edge. Then displacements are carried in place; else in each one's own frame.
  bool coincide = false;
  int unmapped = 0;
};
/// Shape keys: source vertices moved (each n x 3), to the target's vertices moved in the same way.
/// The source's Jacobians, averaged to its vertices, are interpolated along the map and turned into
/// the target's frames, and integrated with positions that hold them: a field smooth over the
/// source's faces. Vertices whose partner, with all around it, is exactly at rest stay exactly at
/// rest. An unmapped vertex moves with the nearest mapped one.
/// Source: Sumner and Popovic 2004, "Deformation Transfer for Triangle Meshes"; positions by the
/// product form of `EmbeddingRecovery`.
/// Errors: those of `TriangleMesh` and `check_surface_map`; `wrong_shape` or `not_finite` for a
/// key; `bad_option` where no vertex is mapped; `cancelled`.
TransferredShapes transfer_shape_keys(const MeshView& source, const std::vector<Points>& keys,
                                      const MeshView& target, const SurfaceMap& map,
                                      ProgressRange progress = {});

struct ShrinkFitOptions {
  int rounds = 4;        ///< >= 1
  double first = 400.0;  ///< pull of the first round (`RecoveryOptions`), > 0
  double growth = 5.0;   ///< of the pull from round to round, >= 1
  bool project = true;   ///< lay the result on the target's surface in the end
};
struct ShrinkFit {
  Points vertices;           ///< source vertices, in the target's units
  Eigen::VectorXd distance;  ///< of each from the target's surface
  int flipped = 0;           ///< faces that turned over (`flipped_faces`)
  int unmapped = 0;
};
/// The target's shape on the source's faces. map: SOURCE vertices to the TARGET's surface. Each
/// round averages the Jacobians of the fit, recovers an embedding near the target with them, so
/// that the source's detail and spacing stay, and finds its nearest points on the target again,
/// first where it faces the same way; a vertex whose projection would turn a face over stays off
/// the surface. Errors: those of `TriangleMesh` and `check_surface_map`; `bad_option`; `cancelled`.
ShrinkFit shrink_fit(const MeshView& source, const MeshView& target, const SurfaceMap& map,
                     const ShrinkFitOptions& options = {}, ProgressRange progress = {});

}  // namespace supple
