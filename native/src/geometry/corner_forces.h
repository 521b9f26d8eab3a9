// SPDX-License-Identifier: GPL-3.0-or-later
// grad^T A X of matrices X that come some faces at a time.
#pragma once

#include <memory>

#include "supple/geometry/surface_operators.h"

namespace supple {

/// What each face's matrix adds at its corners, A grad(phi_c)^T X, kept a face: vertices then
/// gather one line of the cache from each of their faces, instead of its matrix, frame and area.
class CornerForces {
 public:
  /// operators: must outlive this.
  explicit CornerForces(const SurfaceOperators& operators);

  /// matrices: count x 9, row-major, of the faces from `first` on. Of different faces from several
  /// threads.
  void set(Eigen::Index first, Eigen::Index count, const double* matrices);
  /// n x 3, grad^T A X, once all faces are set.
  Points gathered() const;

 private:
  // At corners 1 and 2; at corner 0 it is minus their sum, as the three gradients add up to 0.
  struct alignas(64) Force {
    double one[3], two[3], unused[2];
  };
  const SurfaceOperators& operators_;
  std::unique_ptr<Force[]> forces_;  // m, not set to anything at first: threads touch their own
};

}  // namespace supple
