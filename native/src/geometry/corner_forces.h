// SPDX-License-Identifier: GPL-3.0-or-later
// grad^T A X of matrices X that come some faces at a time.
#pragma once

#include <memory>

#include "supple/geometry/surface_operators.h"

namespace supple {

/// What each face's matrix adds at its corners, A grad(phi_c)^T X, kept a face: vertices then
/// gather one line of the cache from each of their faces, instead of its matrix, frame and area.
/// Scalar: what it is kept in; sums are made in double precision.
template <class Scalar>
class CornerForces {
 public:
  /// At corners 1 and 2; at corner 0 it is minus their sum, as the three gradients add up to 0.
  struct alignas(8 * sizeof(Scalar)) Force {
    Scalar one[3], two[3], unused[2];
  };

  /// operators: must outlive this.
  explicit CornerForces(const SurfaceOperators& operators);

  /// Of face f; of different faces from several threads.
  Force& at(Eigen::Index f) { return forces_[static_cast<size_t>(f)]; }
  /// n x 3, grad^T A X, once all faces are set.
  Points gathered() const;

 private:
  const SurfaceOperators& operators_;
  std::unique_ptr<Force[]> forces_;  // m, not set to anything at first: threads touch their own
};

}  // namespace supple
