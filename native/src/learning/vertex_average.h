// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "supple/geometry/surface_operators.h"

namespace supple {

/// Adds to the m x 9 gradient with respect to a field, from the n x 9 one with respect to its
/// `vertex_average` at every vertex.
inline void add_vertex_average_backward(const SurfaceOperators& operators, const MatrixField& grad,
                                        MatrixField& result) {
  const CornerTable& corners = operators.corners;
#pragma omp parallel for schedule(static)
  for (Eigen::Index f = 0; f < result.rows(); ++f) {
    for (int c = 0; c < 3; ++c) {
      const int v = operators.faces(f, c);
      // The averaging is uniform: 1 / number of faces.
      result.row(f) += grad.row(v) / (corners.first[v + 1] - corners.first[v]);
    }
  }
}

}  // namespace supple
