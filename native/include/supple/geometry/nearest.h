// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "supple/core/types.h"

namespace supple {

/// Nearest points in space by a k-d tree (nanoflann).
class NearestPoints {
 public:
  /// points: n x 3, n >= 1; copied.
  explicit NearestPoints(Points points);
  ~NearestPoints();

  struct Result {
    Eigen::VectorXi index;  ///< q: row of the nearest point, the lowest of those equal to 1e-9
    Eigen::VectorXd squared_distance;  ///< q
  };
  /// queries: q x 3.
  Result query(const Points& queries) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace supple
