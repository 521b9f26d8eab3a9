// SPDX-License-Identifier: GPL-3.0-or-later
// Between maps of the callers' meshes and maps of their surfaces. Private to refine.
#pragma once

#include <vector>

#include "supple/geometry/mesh.h"
#include "supple/geometry/surface_map.h"
#include "supple/tasks/prepared_mesh.h"
#include "supple/tasks/refine.h"

namespace supple::refining {

/// Errors: `bad_option`.
void check_options(const RefineOptions& options);

/// What `Refiner::notes` says.
std::vector<Note> pair_notes(const PreparedMesh& source, const PreparedMesh& target,
                             const RefineOptions& options);

/// n: the surface vertex of each mesh vertex, for one without a face the nearest in space.
Eigen::VectorXi surface_anchor(const TriangleMesh& mesh);

/// A map of mesh vertices as one of surface vertices, ns. Errors: those of `Refiner::refine`.
Eigen::VectorXi to_surfaces(const TriangleMesh& source, const TriangleMesh& target,
                            const Eigen::VectorXi& target_anchor, const Eigen::VectorXi& map);
SurfaceMap to_surfaces(const TriangleMesh& source, const TriangleMesh& target,
                       const SurfaceMap& map);

/// And back: n rows from ns, along `source_anchor`.
Eigen::VectorXi from_surfaces(const TriangleMesh& target, const Eigen::VectorXi& source_anchor,
                              const Eigen::VectorXi& map);
SurfaceMap from_surfaces(const TriangleMesh& target, const Eigen::VectorXi& source_anchor,
                         const SurfaceMap& map);

/// `RefineResult::confidence` at the ns surface vertices.
Eigen::VectorXd confidence(const SurfaceOperators& source, const SurfaceOperators& target,
                           const Points& recovered, const SurfaceMap& map,
                           const Eigen::VectorXi& point_map);

}  // namespace supple::refining
