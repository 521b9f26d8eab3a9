// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/nearest.h"

#include "tasks/initial_map/candidates.h"
#include "tasks/refine/pair.h"

namespace supple {

using initial_maps::MeshPair;

MapScore map_score(const PreparedMesh& source, const PreparedMesh& target,
                   const Eigen::VectorXi& point_map) {
  const MeshPair pair(source, target);
  return pair
      .finished(refining::to_surfaces(source.mesh, target.mesh,
                                      refining::surface_anchor(target.mesh), point_map))
      .score;
}

Eigen::VectorXi zoomout_map(const PreparedMesh& source, const PreparedMesh& target,
                            const Eigen::VectorXi& point_map, ZoomoutOptions options, bool sampled,
                            ProgressRange progress) {
  const Eigen::VectorXi& samples = source.sampled.samples;
  const bool fewer = samples.size() > options.to && samples.size() < source.basis.mass.size();
  options.samples = sampled && fewer ? samples : Eigen::VectorXi();
  const Eigen::VectorXi initial = refining::to_surfaces(
      source.mesh, target.mesh, refining::surface_anchor(target.mesh), point_map);
  const Zoomout refined = zoomout(source.basis, target.basis, initial, options, progress);
  return refining::from_surfaces(target.mesh, refining::surface_anchor(source.mesh),
                                 refined.point_map);
}

InitialMap nearest_map(const PreparedMesh& source, const PreparedMesh& target, bool aligned,
                       ProgressRange progress) {
  progress.report(0.0);
  const MeshPair pair(source, target);
  if (aligned) {
    const auto in_space = [](const TriangleMesh& mesh) {
      return Points(mesh.vertices()(mesh.mesh_vertex(), Eigen::all));
    };
    return pair.finished(NearestPoints(in_space(target.mesh)).query(in_space(source.mesh)).index);
  }
  return pair.finished(nearest_vertices(pair, initial_maps::alignments(pair)[0]));
}

}  // namespace supple
