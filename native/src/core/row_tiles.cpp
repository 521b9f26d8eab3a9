// SPDX-License-Identifier: GPL-3.0-or-later
#include "row_tiles.h"

#include <cmath>
#include <utility>

namespace supple {

RowTiles::RowTiles(const ConstTallBlock<double>& rows_in, std::vector<int> order_in, double scale,
                   Eigen::Index height_in, Eigen::Index first)
    : height(height_in),
      numbers(rows_in.cols()),
      rows(rows_in.rows()),
      count((rows + height - 1) / height),
      order(std::move(order_in)),
      values(static_cast<size_t>(count * height * numbers), 0.0F),
      offsets(static_cast<size_t>(count * height), kNoScore),
      first_offsets(offsets) {
  for (Eigen::Index i = 0; i < rows; ++i) {
    float* const tile = values.data() + i / height * height * numbers + i % height;
    const auto row = rows_in.row(order[static_cast<size_t>(i)]);
    for (Eigen::Index j = 0; j < numbers; ++j) {
      tile[j * height] = static_cast<float>(scale * row[j]);
    }
    offsets[static_cast<size_t>(i)] = static_cast<float>(-0.5 * (scale * row).squaredNorm());
    first_offsets[static_cast<size_t>(i)] =
        static_cast<float>(-0.5 * (scale * row.head(first)).squaredNorm());
  }
}

TileMiddles::TileMiddles(const ConstTallBlock<double>& rows, const RowTiles& tiles, double scale)
    : at(tiles.count, tiles.numbers), radii(static_cast<size_t>(tiles.count)) {
  for (Eigen::Index t = 0; t < tiles.count; ++t) {
    at.row(t).setZero();
    const int* const members = tiles.order.data() + t * tiles.height;
    const Eigen::Index filled = tiles.filled(t);
    for (Eigen::Index i = 0; i < filled; ++i) {
      at.row(t) += rows.row(members[i]) / static_cast<double>(filled);
    }
    double radius = 0.0;
    for (Eigen::Index i = 0; i < filled; ++i) {
      radius = std::max(radius, (rows.row(members[i]) - at.row(t)).squaredNorm());
    }
    radii[static_cast<size_t>(t)] =
        static_cast<float>(scale * std::sqrt(radius)) * (1.0F + 0x1.0p-22F);
  }
}

}  // namespace supple
