// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "supple/geometry/surface_operators.h"

namespace supple {

/// Calls visit(other) for each edge of face f and each other face at it.
template <class Visit>
void for_each_neighbour(const Faces& faces, const CornerTable& corners, Eigen::Index f,
                        const Visit& visit) {
  const auto face = faces.row(f);
  for (int c = 0; c < 3; ++c) {
    // The faces across the edge from this corner to the next: met at this corner only.
    const int from = face[c], to = face[(c + 1) % 3];
    for (int i = corners.first[from]; i < corners.first[from + 1]; ++i) {
      const int other = corners.corner[i] / 3;
      const auto its = faces.row(other);
      if (other != f && (its[0] == to || its[1] == to || its[2] == to)) {
        visit(other);
      }
    }
  }
}

}  // namespace supple
