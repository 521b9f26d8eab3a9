// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/core/nearest_rows.h"

#include <omp.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "nearest_kernels.h"
#include "row_groups.h"
#include "row_tiles.h"
#include "supple/core/error.h"
#include "supple/core/parallel.h"

namespace supple {
namespace {

// Groups of queries that a thread takes at a time, and times it does between two looks at the
// progress.
constexpr Eigen::Index kGroups = 12, kTimesBetweenReports = 2;
constexpr float kFar = 4.0F;  // beyond all rows, whose norms are at most 1
// Tiles that are looked into before the others, the most promising first.
constexpr int kFirst = 16;
// Rows of so many numbers or more are looked at in two steps.
constexpr Eigen::Index kLong = 48;

std::vector<int> in_order(Eigen::Index count) {
  std::vector<int> order(static_cast<size_t>(count));
  std::iota(order.begin(), order.end(), 0);
  return order;
}

// Points that lie close together share a tile, and so do queries. A tile of points is looked into
// only where, by the distance to its middle and its radius, it may hold the nearest of some query
// of a tile; the tiles that promise most come first.
class Search {
 public:
  Search(const ConstTallBlock<double>& queries, const ConstTallBlock<double>& points, double scale)
      : query_rows_(queries),
        point_rows_(points),
        kernel_(nearest_kernel()),
        first_(points.cols() >= kLong ? points.cols() / 3 : 0) {
    run_at_once(2, [&](size_t side) {
      if (side == 0) {
        queries_ = {queries, grouped_rows(queries, kernel_.width), scale, kernel_.width, first_};
        return;
      }
      points_ = {points, grouped_rows(points, kernel_.height), scale, kernel_.height, first_};
      middles_ = {points, points_, scale};
      middle_tiles_ = {middles_.at, in_order(points_.count), scale, kernel_.height};
    });
    // Norms are at most 1. k + 1 products and sums, each operand rounded once before.
    const double rounding = static_cast<double>(points.cols() + 8) * 0x1.0p-23;
    slack_ = static_cast<float>(2.0 * rounding * 1.5);
  }

  Eigen::Index groups() const { return queries_.count; }

  // What a thread needs.
  struct Room {
    Eigen::ArrayXXf away;       // queries x tiles: square of the distance to the middle
    Eigen::ArrayXXf tile_best;  // queries x tiles looked into: the best score there
    Eigen::ArrayXXf scores;     // queries x points of these tiles
    std::vector<unsigned char> within;
    std::vector<int> ahead, looked_into;
  };

  // The queries of one group, a tile.
  void operator()(Eigen::Index group, Room& room, Eigen::VectorXi& nearest) const {
    const Eigen::Index width = kernel_.width;
    room.away.resize(width, middle_tiles_.count * kernel_.height);
    room.tile_best.resize(width, points_.count);
    room.scores.resize(width, points_.count * kernel_.height);
    room.within.resize(static_cast<size_t>(points_.count));
    const Eigen::ArrayXf squares = squares_of(queries_.offsets, group);
    const Eigen::ArrayXf first_squares = squares_of(queries_.first_offsets, group);
    look_at_middles(group, squares, room);
    Eigen::ArrayXf best = Eigen::ArrayXf::Constant(width, kNoScore);
    Eigen::ArrayXf far = Eigen::ArrayXf::Constant(width, kFar), far_squares = far.square();
    Eigen::ArrayXf enough = best;
    const auto look_into = [&](int t) {
      const auto place = static_cast<Eigen::Index>(room.looked_into.size());
      if (!kernel_.score({queries_.tile(group), points_.tile(t), points_.offsets_of(t),
                          points_.numbers, first_, points_.first_offsets_of(t), enough.data(),
                          room.scores.col(place * kernel_.height).data(),
                          room.tile_best.col(place).data()})) {
        return;
      }
      room.looked_into.push_back(t);
      if ((room.tile_best.col(place) > best).any()) {
        best = best.max(room.tile_best.col(place));
        far_squares = (squares - 2.0F * best).max(0.0F) + 4.0F * slack_;
        far = far_squares.sqrt();
        enough = 0.5F * (first_squares - far_squares);
      }
    };
    room.looked_into.clear();
    for (const int t : room.ahead) {
      look_into(t);
    }
    kernel_.reach({room.away.data(), far.data(), far_squares.data(), middles_.radii.data(),
                   points_.count, room.within.data()});
    for (const int t : room.ahead) {
      room.within[static_cast<size_t>(t)] = 0;
    }
    for (int t = 0; t < static_cast<int>(points_.count); ++t) {
      if (room.within[static_cast<size_t>(t)] != 0) {
        look_into(t);
      }
    }
    choose(group, best, room, nearest);
  }

 private:
  // |x|^2 of a group's queries; 1 for those that fill the last one up.
  Eigen::ArrayXf squares_of(const std::vector<float>& offsets, Eigen::Index group) const {
    const Eigen::Index width = kernel_.width;
    return -2.0F *
           Eigen::Map<const Eigen::ArrayXf>(offsets.data() + group * width, width).max(-0.5F);
  }

  // How far each tile's middle is, and the tiles that come nearest to a query.
  void look_at_middles(Eigen::Index group, const Eigen::ArrayXf& squares, Room& room) const {
    const Eigen::Index height = kernel_.height;
    Eigen::ArrayXf unused(kernel_.width);
    std::vector<float> least(static_cast<size_t>(points_.count));
    for (Eigen::Index t = 0; t < middle_tiles_.count; ++t) {
      kernel_.score({queries_.tile(group), middle_tiles_.tile(t), middle_tiles_.offsets_of(t),
                     points_.numbers, 0, nullptr, nullptr, room.away.col(t * height).data(),
                     unused.data()});
    }
    for (Eigen::Index t = 0; t < points_.count; ++t) {
      room.away.col(t) = squares - 2.0F * room.away.col(t) - 2.0F * slack_;
      const float square = room.away.col(t).minCoeff();
      least[static_cast<size_t>(t)] =
          std::sqrt(std::max(square, 0.0F)) - middles_.radii[static_cast<size_t>(t)];
    }
    std::vector<int> tiles = in_order(points_.count);
    const auto ahead = tiles.begin() + std::min<Eigen::Index>(kFirst, points_.count);
    std::partial_sort(tiles.begin(), ahead, tiles.end(), [&](int a, int b) {
      const float x = least[static_cast<size_t>(a)], y = least[static_cast<size_t>(b)];
      return x < y || (x == y && a < b);
    });
    room.ahead.assign(tiles.begin(), ahead);
  }

  // Compares, in double precision, the points whose score is at most `slack` below the best.
  void choose(Eigen::Index group, const Eigen::ArrayXf& best, const Room& room,
              Eigen::VectorXi& nearest) const {
    const Eigen::Index filled = queries_.filled(group);
    std::vector<double> least(static_cast<size_t>(filled), std::numeric_limits<double>::infinity());
    const int* const members = queries_.order.data() + group * kernel_.width;
    for (Eigen::Index place = 0; place < static_cast<Eigen::Index>(room.looked_into.size());
         ++place) {
      if (((room.tile_best.col(place) - best).maxCoeff()) < -slack_) {
        continue;
      }
      const Eigen::Index t = room.looked_into[static_cast<size_t>(place)];
      for (Eigen::Index q = 0; q < filled; ++q) {
        const float enough = best[q] - slack_;
        if (room.tile_best(q, place) < enough) {
          continue;
        }
        for (Eigen::Index p = 0; p < points_.filled(t); ++p) {
          if (room.scores(q, place * kernel_.height + p) >= enough) {
            compare(members[q], points_.order[static_cast<size_t>(t * kernel_.height + p)],
                    least[static_cast<size_t>(q)], nearest);
          }
        }
      }
    }
  }

  void compare(int query, int point, double& least, Eigen::VectorXi& nearest) const {
    const double away = (query_rows_.row(query) - point_rows_.row(point)).squaredNorm();
    if (away < least || (away == least && point < nearest[query])) {
      least = away;
      nearest[query] = point;
    }
  }

  const ConstTallBlock<double>& query_rows_;
  const ConstTallBlock<double>& point_rows_;
  NearestKernel kernel_;
  Eigen::Index first_;  // numbers that are looked at before the others; 0: all at once
  RowTiles queries_, points_;
  TileMiddles middles_;
  RowTiles middle_tiles_;
  float slack_ = 0.0F;
};

double largest_norm(const ConstTallBlock<double>& rows) {
  return rows.size() == 0 ? 0.0
                          : std::sqrt(rows.rowwise().squaredNorm().maxCoeff<Eigen::PropagateNaN>());
}

}  // namespace

Eigen::VectorXi nearest_rows(const ConstTallBlock<double>& queries,
                             const ConstTallBlock<double>& points, ProgressRange progress) {
  if (queries.cols() != points.cols() || points.rows() == 0) {
    throw Error(ErrorCode::wrong_shape,
                "The nearest of " + std::to_string(points.rows()) + " rows of " +
                    std::to_string(points.cols()) + " numbers is looked for, to rows of " +
                    std::to_string(queries.cols()) + "; there must be one, of as many.");
  }
  double query_size = 0.0, point_size = 0.0;
  run_at_once(2, [&](size_t side) {
    side == 0 ? query_size = largest_norm(queries) : point_size = largest_norm(points);
  });
  if (!std::isfinite(query_size) || !std::isfinite(point_size)) {
    throw Error(ErrorCode::not_finite,
                "The rows to compare hold NaN or infinity. Check the functions and the map.");
  }
  progress.report(0.0);
  const double size = std::max(query_size, point_size);
  const Search search(queries, points, size > 0.0 ? 1.0 / size : 1.0);
  Eigen::VectorXi nearest = Eigen::VectorXi::Zero(queries.rows());
  const Eigen::Index blocks = (search.groups() + kGroups - 1) / kGroups;
  const int threads = omp_in_parallel() ? 1 : omp_get_max_threads();
  const Eigen::Index together = kTimesBetweenReports * threads;
  std::vector<Search::Room> rooms(static_cast<size_t>(threads));
  for (Eigen::Index start = 0; start < blocks; start += together) {
    const Eigen::Index end = std::min(blocks, start + together);
    std::atomic<bool> no_memory{false};  // nothing may be thrown out of the loop
#pragma omp parallel for schedule(dynamic, 1) num_threads(threads) if (threads > 1)
    for (Eigen::Index b = start; b < end; ++b) {
      try {
        Search::Room& room = rooms[static_cast<size_t>(threads > 1 ? omp_get_thread_num() : 0)];
        const Eigen::Index last = std::min(search.groups(), (b + 1) * kGroups);
        for (Eigen::Index group = b * kGroups; group < last; ++group) {
          search(group, room, nearest);
        }
      } catch (const std::bad_alloc&) {
        no_memory = true;
      }
    }
    if (no_memory) {
      throw std::bad_alloc();
    }
    progress.report(static_cast<double>(end) / static_cast<double>(blocks));
  }
  return nearest;
}

}  // namespace supple
