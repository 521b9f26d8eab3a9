// SPDX-License-Identifier: GPL-3.0-or-later
// What the ways to a first map share: samples, scores, and laying two meshes on one another.
#pragma once

#include <vector>

#include "supple/spectral/map_fit.h"
#include "supple/tasks/initial_map.h"

namespace supple::initial_maps {

/// A functional map, by how plausible it is.
struct Candidate {
  RowMatrix<double> map;
  MapScore score;
  double value = 0.0;  ///< what it is chosen by
};

/// Two meshes with samples on both.
class MeshPair {
 public:
  /// extra: surface vertices that are samples too, at the end of both lists, in this order.
  /// samples: of the source; the target has twice as many.
  MeshPair(const PreparedMesh& source, const PreparedMesh& target,
           const std::vector<std::pair<int, int>>& extra = {}, Eigen::Index samples = 1000);

  const PreparedMesh& source;
  const PreparedMesh& target;
  Eigen::Index count;                              ///< eigenfunctions that a map is judged in
  Eigen::VectorXi source_samples, target_samples;  ///< surface vertices
  SampledFunctions source_functions, target_functions;

  /// images: surface vertices of the target, of `places` of the source.
  MapScore score(const RowMatrix<double>& map, const Eigen::VectorXi& places,
                 const Eigen::VectorXi& images) const;
  /// With the images that the map gives the samples.
  MapScore score(const RowMatrix<double>& map) const;
  /// The map of all source vertices, with its score and what it says of it.
  InitialMap finished(const RowMatrix<double>& map, ProgressRange progress) const;
  /// From surface vertices to the callers' vertices; scored.
  InitialMap finished(const Eigen::VectorXi& surface_map) const;
};

/// A rigid motion of the source's surface onto the target's: v -> v R + t.
struct Alignment {
  Matrix3 rotation;
  Eigen::RowVector3d shift;
  double residual = 0.0;  ///< mean squared distances of nearest samples, both ways
};
/// The ways to lay the principal axes on one another, after rigid ICP on the samples, best first.
/// Source: Besl and McKay 1992.
std::vector<Alignment> alignments(const MeshPair& pair);
/// The rotation and shift nearest to taking each row of `from` to the same of `to`.
Alignment closest_motion(const Points& from, const Points& to);
/// Surface vertices: the nearest target vertex of each source vertex once moved.
Eigen::VectorXi nearest_vertices(const MeshPair& pair, const Alignment& alignment);

/// k x count: the coefficients of columns scaled to norm 1 over both surfaces, times `weight`;
/// added on the right of both.
void add_descriptors(const MeshPair& pair, Eigen::Index functions, RowMatrix<double> source,
                     RowMatrix<double> target, double weight, MapConstraints& constraints);
/// Adds the orientation operators of every `every`-th column.
void add_operators(const MeshPair& pair, Eigen::Index functions, const RowMatrix<double>& source,
                   const RowMatrix<double>& target, Eigen::Index every,
                   MapConstraints& constraints);

}  // namespace supple::initial_maps
