// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/face_adjacency.h"

#include <vector>

#include "neighbours.h"

namespace supple {

SparseRowMatrix face_adjacency(const Faces& faces, const CornerTable& corners) {
  std::vector<Eigen::Triplet<double>> entries;
  std::vector<int> neighbours;
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    neighbours.clear();
    for_each_neighbour(faces, corners, f, [&](int other) { neighbours.push_back(other); });
    if (neighbours.empty()) {
      neighbours.push_back(static_cast<int>(f));
    }
    for (const int other : neighbours) {
      entries.emplace_back(static_cast<int>(f), other,
                           1.0 / static_cast<double>(neighbours.size()));
    }
  }
  SparseRowMatrix adjacency(faces.rows(), faces.rows());
  adjacency.setFromTriplets(entries.begin(), entries.end());
  return adjacency;
}

}  // namespace supple
