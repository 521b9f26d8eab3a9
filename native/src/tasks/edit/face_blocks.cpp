// SPDX-License-Identifier: GPL-3.0-or-later
#include "face_blocks.h"

#include <algorithm>

namespace supple {

BlockField in_blocks(const MatrixField& field) {
  BlockField result(static_cast<size_t>(block_count(field.rows())));
#pragma omp parallel for schedule(static)
  for (Eigen::Index b = 0; b < block_count(field.rows()); ++b) {
    for (Eigen::Index i = 0; i < kBlock; ++i) {
      const Eigen::Index f = kBlock * b + i;
      for (int e = 0; e < 9; ++e) {
        result[static_cast<size_t>(b)].e[e][i] =
            f < field.rows() ? field(f, e) : double(e % 4 == 0);
      }
    }
  }
  return result;
}

FaceBlocks::FaceBlocks(const SurfaceOperators& operators_in)
    : operators(operators_in),
      inverse_frames(in_blocks(operators.inverse_frames)),
      areas(static_cast<size_t>(kBlock * block_count(operators.faces.rows())), 0.0) {
  std::copy_n(operators.face_areas.data(), operators.face_areas.size(), areas.data());
}

}  // namespace supple
