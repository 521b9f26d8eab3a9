// SPDX-License-Identifier: GPL-3.0-or-later
// Rows of many numbers in tiles, as kernels read them.
#pragma once

#include <algorithm>
#include <limits>
#include <vector>

#include "supple/core/tall.h"
#include "supple/core/types.h"

namespace supple {

inline constexpr float kNoScore = -std::numeric_limits<float>::max();  // less than any score

// Rows in tiles of so many that lie close together: within one, number by number (count x height),
// so that a kernel reads them one after the other.
struct RowTiles {
  RowTiles() = default;
  RowTiles(const ConstTallBlock<double>& rows_in, std::vector<int> order_in, double scale,
           Eigen::Index height_in, Eigen::Index first = 0);

  const float* tile(Eigen::Index t) const { return values.data() + t * height * numbers; }
  const float* offsets_of(Eigen::Index t) const { return offsets.data() + t * height; }
  const float* first_offsets_of(Eigen::Index t) const { return first_offsets.data() + t * height; }
  // Rows in tile t.
  Eigen::Index filled(Eigen::Index t) const { return std::min(height, rows - t * height); }

  Eigen::Index height = 0, numbers = 0, rows = 0, count = 0;
  std::vector<int> order;            // the row at each place
  std::vector<float> values;         // zeros fill the last tile up
  std::vector<float> offsets;        // -|y|^2 / 2; kNoScore fills the last tile up
  std::vector<float> first_offsets;  // the same of the first numbers alone
};

// The middles of tiles, and how far a tile's rows are from theirs at most.
struct TileMiddles {
  TileMiddles() = default;
  TileMiddles(const ConstTallBlock<double>& rows, const RowTiles& tiles, double scale);

  RowMatrix<double> at;
  std::vector<float> radii;
};

}  // namespace supple
