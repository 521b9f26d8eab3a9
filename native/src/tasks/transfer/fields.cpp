// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <string>
#include <utility>

#include "supple/core/error.h"
#include "supple/tasks/transfer.h"
#include "tasks/transfer/islands.h"

namespace supple {
namespace {

// Weights come as single precision, summed over a few groups.
constexpr double kSumsToOne = 1e-4;

void check_weights(const RowMatrix<double>& weights, Eigen::Index vertices) {
  if (weights.rows() != vertices) {
    throw Error(ErrorCode::wrong_shape, "There are weights for " + std::to_string(weights.rows()) +
                                            " vertices; the source has " +
                                            std::to_string(vertices) + ".");
  }
  for (Eigen::Index i = 0; i < weights.rows(); ++i) {
    if (!weights.row(i).allFinite()) {
      throw Error(ErrorCode::not_finite, "Vertex " + std::to_string(i) +
                                             " of the source has a weight that is not a finite "
                                             "number.");
    }
    if (weights.cols() > 0 && weights.row(i).minCoeff() < 0.0) {
      throw Error(ErrorCode::bad_option,
                  "Vertex " + std::to_string(i) + " of the source has a weight below 0.");
    }
  }
}

bool is_normalised(const RowMatrix<double>& weights) {
  bool any = false;
  for (Eigen::Index i = 0; i < weights.rows(); ++i) {
    const double sum = weights.row(i).sum();
    if (sum > 0.0 && std::abs(sum - 1.0) > kSumsToOne) {
      return false;
    }
    any = any || sum > 0.0;
  }
  return any;
}

}  // namespace

TransferredField transfer_field(const SurfaceMap& map, const Faces& source_faces,
                                const RowMatrix<double>& field, double otherwise) {
  return {apply(map, source_faces, field, otherwise), count_unmapped(map.face)};
}

TransferredGroups transfer_groups(const SurfaceMap& map, const MeshView& source,
                                  const Faces& target_faces, const RowMatrix<double>& weights,
                                  const GroupOptions& options) {
  if (!(options.smallest >= 0.0 && options.smallest < 1.0)) {
    throw Error(ErrorCode::bad_option, "The smallest weight is at least 0 and below 1, not " +
                                           std::to_string(options.smallest) + ".");
  }
  check_weights(weights, source.vertices.rows());
  const IslandMap held = within_islands(map, source, target_faces, options.majority);
  TransferredGroups result{apply(held.map, source.faces, weights), is_normalised(weights),
                           count_unmapped(map.face), held.moved};
  for (Eigen::Index i = 0; i < result.weights.rows(); ++i) {
    auto row = result.weights.row(i);
    const double before = row.sum();
    for (double& weight : row) {
      weight = weight < options.smallest ? 0.0 : weight;
    }
    const double sum = row.sum();
    if (sum > 0.0) {
      // A vertex that is only partly weighted (near vertices of no group) stays partly weighted
      // unless the source is normalised; what was pruned is shared by the rest.
      row *= (result.normalised ? 1.0 : before) / sum;
    }
  }
  return result;
}

}  // namespace supple
