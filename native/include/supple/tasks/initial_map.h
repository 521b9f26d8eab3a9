// SPDX-License-Identifier: GPL-3.0-or-later
// Ways to a first, rough map between two meshes, for `Refiner` to refine. n source and t target
// vertices, as in the callers' meshes, imperfect ones included.
#pragma once

#include <vector>

#include "supple/core/progress.h"
#include "supple/core/types.h"
#include "supple/geometry/mesh.h"
#include "supple/spectral/functional_map.h"
#include "supple/tasks/prepared_mesh.h"

namespace supple {

/// How plausible a map is, seen through 60 eigenfunctions; no truth is needed. Each in [0, 1].
struct MapScore {
  /// Mean over the source of max(0, cosine) between the normals of the source laid onto the target
  /// and the target's own there: near 0 for a map with left and right exchanged, which turns the
  /// surface inside out.
  double orientation = 0.0;
  /// The Dirichlet energies of the target's coordinates and of what is pulled back of them, the
  /// smaller over the larger, square root.
  double smoothness = 0.0;
  /// k / (k + |C^T C - 1|^2): 1 where areas are kept and nothing is missed.
  double area = 0.0;
  double value() const { return orientation * smoothness * area; }
};

struct InitialMap {
  Eigen::VectorXi point_map;  ///< n, a target vertex each
  MapScore score;
  /// "mirrored": orientation below 0.3; "uncertain": another candidate, elsewhere, was as good;
  /// "partial_overlap" (of UVs).
  std::vector<Note> notes;
};

/// Of any map. Errors: `wrong_shape`, `index_out_of_range`.
MapScore map_score(const PreparedMesh& source, const PreparedMesh& target,
                   const Eigen::VectorXi& point_map);

/// `zoomout` of a map of the callers' vertices. One without a face takes its nearest surface
/// vertex's place, on either mesh. options.samples: not given by the caller, but, if `sampled`, the
/// source's prepared ones (every vertex where they are no more than options.to).
/// Errors: those of `zoomout`.
Eigen::VectorXi zoomout_map(const PreparedMesh& source, const PreparedMesh& target,
                            const Eigen::VectorXi& point_map, ZoomoutOptions options = {},
                            bool sampled = false, ProgressRange progress = {});

/// From pairs of vertices that correspond, one or more: heat and wave kernels around them and wave
/// kernel signatures, an orientation term, and ZoomOut that holds the pairs. The map has them
/// exactly. source, target: one vertex each a pair.
/// Errors: `wrong_shape` for lists of different or no length; `index_out_of_range`; `bad_option`
/// for a vertex in two pairs; `cancelled`.
InitialMap landmark_map(const PreparedMesh& source, const PreparedMesh& target,
                        const Eigen::VectorXi& source_landmarks,
                        const Eigen::VectorXi& target_landmarks, ProgressRange progress = {});

/// The nearest target vertex in space. aligned: the meshes lie as they should, in the same units.
/// Otherwise size and place are made the same, and of the 24 ways to lay the principal axes on one
/// another the one that rigid ICP brings nearest is taken; none mirrors.
InitialMap nearest_map(const PreparedMesh& source, const PreparedMesh& target, bool aligned = false,
                       ProgressRange progress = {});

/// The target vertex at the same place in a UV layout that both share. uvs: 3m x 2, one a corner,
/// of all of a mesh's faces. Where a vertex has several places (a seam) the one that the target
/// overlaps best counts. Source vertices outside the target's layout take its nearest place, and
/// "partial_overlap" says how many.
/// Errors: `wrong_shape`, `not_finite`; `bad_option` where less than one vertex in a hundred
/// overlaps.
InitialMap uv_map(const PreparedMesh& source, const PreparedMesh& target,
                  const RowMatrix<double>& source_uvs, const RowMatrix<double>& target_uvs);

/// From the shapes alone: candidates from wave kernel signatures with an orientation term, from the
/// signs of the first eigenfunctions, and from laying the meshes on one another, each upsampled by
/// ZoomOut; the best score wins, so that left and right are told apart where the surface tells.
/// Errors: `bad_option` for meshes of less than 8 eigenfunctions; `cancelled`.
InitialMap automatic_map(const PreparedMesh& source, const PreparedMesh& target,
                         ProgressRange progress = {});

}  // namespace supple
