// SPDX-License-Identifier: GPL-3.0-or-later
// Where pieces are between the keys: what Jacobians leave open. K keys; n surface vertices, m
// faces.
#pragma once

#include <vector>

#include "key_times.h"
#include "supple/tasks/prepared_mesh.h"

namespace supple {

/// Positions at the keys, surface units, in the frame of a surface vertex and a face at it, or in
/// the world's where there is none.
struct Track {
  int vertex = -1, face = -1;
  Points places;  ///< K x 3

  /// Where it is at a time. moved: n x 3; rotations: m x 9 there. Read only with a frame.
  Eigen::RowVector3d at(const KeyWeights& weights, const Points& moved,
                        const MatrixField& rotations) const;
};

/// Translations of the components, and the vertices without faces. Immutable.
class Placement {
 public:
  /// poses: all vertices of the mesh at each key, surface units. rotations: m x 9 at each key.
  Placement(const PreparedMesh& prepared, const std::vector<Points>& poses,
            const std::vector<MatrixField>& rotations);

  /// For each component the face of the largest one that it follows; -1 for none.
  std::vector<int> guides() const;
  /// Moves each component of n x 3 vertices to its place.
  void place(const KeyWeights& weights, const MatrixField& rotations, Points& moved) const;
  /// Writes the vertices without faces into all of the mesh's, surface units.
  void place_unattached(const KeyWeights& weights, const Points& moved,
                        const MatrixField& rotations, Points& all) const;

 private:
  Eigen::VectorXi component_;
  std::vector<Track> tracks_;  // of each component's weighted mean
  int largest_;                // component
  Eigen::VectorXd shares_;     // n: weights that sum to 1 in each component
  std::vector<int> unattached_;
  std::vector<Track> unattached_tracks_;
};

}  // namespace supple
