// SPDX-License-Identifier: GPL-3.0-or-later
#include "face_blocks.h"

#include <algorithm>

namespace supple {

BlockField in_blocks(const MatrixField& field) {
  BlockField result(static_cast<size_t>(block_count(field.rows())));
#pragma omp parallel for schedule(static)
  for (Eigen::Index b = 0; b < block_count(field.rows()); ++b) {
    load_rows(field.row(kBlock * b).data(), std::min(kBlock, field.rows() - kBlock * b),
              result[static_cast<size_t>(b)]);
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
