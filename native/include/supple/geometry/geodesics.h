// SPDX-License-Identifier: GPL-3.0-or-later
// Lengths of the shortest paths on a triangle mesh, exact: paths cross faces in straight lines, so
// that they are right at the scale of one edge, where graph distances and fast marching are not.
#pragma once

#include <memory>

#include "supple/core/progress.h"
#include "supple/core/types.h"

namespace supple {

/// Shortest paths between vertices, by windows sent across the faces in order of their distance.
/// Boundaries and edges of three or more faces are walked along and through. Immutable; safe to use
/// from several threads.
/// Source: Mitchell, Mount and Papadimitriou 1987; Chen and Han 1990 ("one angle, one split"); the
/// order and the test that drops a window, Xin and Wang 2009, "Improving Chen and Han's algorithm".
class Geodesics {
 public:
  /// vertices: n x 3, finite, any units; faces: m x 3. Faces without area are left out.
  /// Errors: `not_finite`, `index_out_of_range`.
  Geodesics(const Points& vertices, const Faces& faces);
  ~Geodesics();

  /// n: from a vertex to each vertex, in the vertices' units; infinity where no path leads.
  /// Errors: `index_out_of_range`.
  Eigen::VectorXd distances(int source) const;

  /// p x q: from `sources[i]` (p) to each of `targets(i, ...)`. Work stops once all of a row are
  /// reached, so near targets cost little; rows of the same source share the work. Threads share
  /// the sources. Errors: `wrong_shape`, `index_out_of_range`; `cancelled`.
  RowMatrix<double> between(const Eigen::VectorXi& sources, const RowMatrix<int>& targets,
                            ProgressRange progress = {}) const;

 private:
  struct Impl;
  std::unique_ptr<const Impl> impl_;
};

}  // namespace supple
