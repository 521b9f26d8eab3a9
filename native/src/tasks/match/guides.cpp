// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/spectral/functional_map.h"
#include "supple/tasks/match.h"
#include "tasks/refine/pair.h"

namespace supple {
namespace {

// Mean by area of how far from its start each vertex ends.
double there_and_back(const PreparedMesh& mesh, const Eigen::VectorXi& there,
                      const Eigen::VectorXi& back) {
  const Points& vertices = mesh.operators.vertices;
  double sum = 0.0;
  for (Eigen::Index i = 0; i < there.size(); ++i) {
    sum += mesh.operators.mass[i] * (vertices.row(back[there[i]]) - vertices.row(i)).norm();
  }
  return sum / mesh.operators.mass.sum();
}

}  // namespace

std::shared_ptr<const JointSurface<float>> joint_surface(const PreparedMesh& mesh,
                                                         const MatchNetworks& networks,
                                                         int functions) {
  return std::make_shared<const JointSurface<float>>(
      mesh.operators, mesh.basis, networks.features.architecture, functions,
      networks.jacobians.has_value() ? mesh.context_for(networks.jacobians->architecture())
                                     : nullptr);
}

GuideMaps guide_maps(const PreparedMesh& first, const PreparedMesh& second, int functions,
                     ProgressRange progress) {
  const std::array<const PreparedMesh*, 2> meshes = {&first, &second};
  GuideMaps result;
  std::array<Eigen::VectorXi, 2> on_surfaces;
  for (size_t d = 0; d < 2; ++d) {
    const PreparedMesh &source = *meshes[d], &target = *meshes[1 - d];
    result.point_maps[d] = automatic_map(source, target,
                                         progress.stage("looking for a first map", 0.5 * double(d),
                                                        0.5 * double(d + 1)))
                               .point_map;
    on_surfaces[d] = refining::to_surfaces(
        source.mesh, target.mesh, refining::surface_anchor(target.mesh), result.point_maps[d]);
    result.maps[d] =
        functional_map(source.basis, target.basis, on_surfaces[d],
                       source.basis.stable_count(functions), target.basis.stable_count(functions));
  }
  result.round_trip = (there_and_back(first, on_surfaces[0], on_surfaces[1]) +
                       there_and_back(second, on_surfaces[1], on_surfaces[0])) /
                      2.0;
  return result;
}

}  // namespace supple
