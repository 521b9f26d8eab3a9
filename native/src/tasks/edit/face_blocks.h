// SPDX-License-Identifier: GPL-3.0-or-later
// Faces eight by eight, number e of all eight matrices side by side: what rounds of an edit compute
// with, whole vectors at a time.
#pragma once

#include <vector>

#include "supple/core/simd.h"
#include "supple/geometry/surface_operators.h"

namespace supple {

constexpr Eigen::Index kBlock = 8;

/// 3x3 matrices of eight faces; number 3 i + j of face f is e[3 i + j][f].
struct alignas(64) MatrixBlock {
  double e[9][kBlock];
};

/// Sets a block to `count` matrices, rows of 9 numbers; those beyond become the identity.
SUPPLE_INLINE void load_rows(const double* rows, Eigen::Index count, MatrixBlock& out) {
  for (Eigen::Index i = 0; i < kBlock; ++i) {
    for (int e = 0; e < 9; ++e) {
      out.e[e][i] = i < count ? rows[9 * i + e] : double(e % 4 == 0);
    }
  }
}

inline Eigen::Index block_count(Eigen::Index faces) { return (faces + kBlock - 1) / kBlock; }

/// A field of m matrices. Those beyond the last face are the identity.
using BlockField = std::vector<MatrixBlock>;
/// field: m x 9.
BlockField in_blocks(const MatrixField& field);

/// What rounds need of a rest surface. Immutable.
struct FaceBlocks {
  /// operators: kept, not owned.
  explicit FaceBlocks(const SurfaceOperators& operators);

  const SurfaceOperators& operators;
  BlockField inverse_frames;  ///< E1^-1
  std::vector<double> areas;  ///< a face; 0 beyond the last
};

}  // namespace supple
