// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/core/nearest_rows.h"

#include <omp.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "supple/core/error.h"
#include "supple/core/simd.h"

namespace supple {
namespace {

constexpr float kNone = -std::numeric_limits<float>::max();  // less than any score
// Queries that a thread works on at a time; their rows stay in the second-level cache.
constexpr Eigen::Index kQueries = 384;  // a multiple of every kernel's width
// Blocks of queries between two looks at the progress, a thread.
constexpr Eigen::Index kBlocksBetweenReports = 2;
// Tiles of points whose best scores are looked through together.
constexpr Eigen::Index kTogether = 8;

// Points in tiles of so many: within one, number by number (count x height), so that a kernel reads
// them one after the other.
struct Tiles {
  Tiles(const RowMatrix<double>& points, double scale, Eigen::Index height_in)
      : height(height_in),
        numbers(points.cols()),
        count((points.rows() + height - 1) / height),
        values(static_cast<size_t>(count * height * numbers), 0.0F),
        offsets(static_cast<size_t>(count * height), kNone) {
    for (Eigen::Index i = 0; i < points.rows(); ++i) {
      float* const tile = values.data() + (i / height) * height * numbers + i % height;
      double norm = 0.0;
      for (Eigen::Index j = 0; j < numbers; ++j) {
        const double value = scale * points(i, j);
        tile[j * height] = static_cast<float>(value);
        norm += value * value;
      }
      offsets[static_cast<size_t>(i)] = static_cast<float>(-0.5 * norm);
    }
  }

  Eigen::Index height, numbers, count;
  std::vector<float> values, offsets;  // offsets: -|y|^2 / 2; kNone fills the last tile up
};

// Some queries against all points. The score of a point y for a query x is x . y - |y|^2 / 2, the
// larger the nearer.
struct Block {
  const Tiles* tiles;
  const float* queries;  // tiles of the kernel's width, number by number, as the points
  Eigen::Index count;    // queries, a multiple of the kernel's width
  float* best;           // count: the best score of each
  float* tile_best;      // tiles x count: the best score of each among a tile's points
};

template <int Bytes>
using Vector = typename Lanes<float, Bytes>::type;

// By reference: a vector wider than plain x86-64's is no value to return.
template <int Bytes>
SUPPLE_INLINE void load(const float* from, Vector<Bytes>& value) {
  typedef Vector<Bytes> Unaligned __attribute__((aligned(4), may_alias));
  value = *reinterpret_cast<const Unaligned*>(from);
}
template <int Bytes>
SUPPLE_INLINE void store(float* to, const Vector<Bytes>& value) {
  typedef Vector<Bytes> Unaligned __attribute__((aligned(4), may_alias));
  *reinterpret_cast<Unaligned*>(to) = value;
}

// Two vectors of queries against Height points, whose scores stay in registers.
template <int Bytes, int Height>
SUPPLE_INLINE void score_body(const Block& block) {
  using V = Vector<Bytes>;
  constexpr Eigen::Index lanes = Lanes<float, Bytes>::count, width = 2 * lanes;
  const Eigen::Index numbers = block.tiles->numbers;
  for (Eigen::Index t = 0; t < block.tiles->count; ++t) {
    const float* const points = block.tiles->values.data() + t * Height * numbers;
    const float* const offsets = block.tiles->offsets.data() + t * Height;
    for (Eigen::Index q = 0; q < block.count; q += width) {
      const float* const queries = block.queries + q * numbers;
      V a[Height], b[Height];
#pragma GCC unroll 16
      for (int p = 0; p < Height; ++p) {
        a[p] = b[p] = V{} + offsets[p];
      }
      for (Eigen::Index j = 0; j < numbers; ++j) {
        V u, v;
        load<Bytes>(queries + j * width, u);
        load<Bytes>(queries + j * width + lanes, v);
        const float* const y = points + j * Height;
#pragma GCC unroll 16
        for (int p = 0; p < Height; ++p) {
          a[p] += y[p] * u;
          b[p] += y[p] * v;
        }
      }
      V most_a = a[0], most_b = b[0];
#pragma GCC unroll 16
      for (int p = 1; p < Height; ++p) {
        most_a = a[p] > most_a ? a[p] : most_a;
        most_b = b[p] > most_b ? b[p] : most_b;
      }
      float* const here = block.tile_best + t * block.count + q;
      store<Bytes>(here, most_a);
      store<Bytes>(here + lanes, most_b);
      V best_a, best_b;
      load<Bytes>(block.best + q, best_a);
      load<Bytes>(block.best + q + lanes, best_b);
      store<Bytes>(block.best + q, most_a > best_a ? most_a : best_a);
      store<Bytes>(block.best + q + lanes, most_b > best_b ? most_b : best_b);
    }
  }
}

struct Kernel {
  void (*score)(const Block&);
  Eigen::Index width, height;  // queries and points at a time
};
SUPPLE_AVX512 void score_avx512(const Block& block) { score_body<64, 12>(block); }
SUPPLE_AVX2 void score_avx2(const Block& block) { score_body<32, 6>(block); }
void score_plain(const Block& block) { score_body<16, 6>(block); }

Kernel kernel() {
  switch (simd_level()) {
    case SimdLevel::avx512:
      return {score_avx512, 32, 12};
    case SimdLevel::avx2:
      return {score_avx2, 16, 6};
    case SimdLevel::plain:
      break;
  }
  return {score_plain, 8, 6};
}

class Search {
 public:
  Search(const RowMatrix<double>& queries, const RowMatrix<double>& points, double scale)
      : queries_(queries),
        points_(points),
        scale_(scale),
        kernel_(kernel()),
        tiles_(points, scale, kernel_.height) {
    // Norms are at most 1. k + 1 products and sums, each operand rounded once before.
    const double rounding = static_cast<double>(points.cols() + 8) * 0x1.0p-23;
    slack_ = static_cast<float>(2.0 * rounding * 1.5);
  }

  // The queries from `first`, kQueries of them or what is left.
  void operator()(Eigen::Index first, Eigen::VectorXi& nearest) const {
    const Eigen::Index rows = std::min(kQueries, queries_.rows() - first), k = queries_.cols();
    const Eigen::Index width = kernel_.width, count = (rows + width - 1) / width * width;
    std::vector<float> packed(static_cast<size_t>(count * k), 0.0F);
    for (Eigen::Index i = 0; i < rows; ++i) {
      float* const tile = packed.data() + i / width * width * k + i % width;
      for (Eigen::Index j = 0; j < k; ++j) {
        tile[j * width] = static_cast<float>(scale_ * queries_(first + i, j));
      }
    }
    std::vector<float> best(static_cast<size_t>(count), kNone);
    std::vector<float> tile_best(static_cast<size_t>(count * tiles_.count));
    kernel_.score({&tiles_, packed.data(), count, best.data(), tile_best.data()});
    choose(first, rows, count, best, tile_best, nearest);
  }

 private:
  // Compares the points of the tiles that may hold the nearest: those whose best score is at most
  // `slack` below the best of all. In ascending order, so that the first of equals stays.
  void choose(Eigen::Index first, Eigen::Index rows, Eigen::Index count,
              const std::vector<float>& best, const std::vector<float>& tile_best,
              Eigen::VectorXi& nearest) const {
    std::vector<double> least(static_cast<size_t>(rows), std::numeric_limits<double>::infinity());
    std::vector<float> most(static_cast<size_t>(count));
    nearest.segment(first, rows).setZero();
    for (Eigen::Index start = 0; start < tiles_.count; start += kTogether) {
      const Eigen::Index end = std::min(tiles_.count, start + kTogether);
      std::fill(most.begin(), most.end(), kNone);
      for (Eigen::Index t = start; t < end; ++t) {
        const float* const here = tile_best.data() + t * count;
        for (Eigen::Index q = 0; q < count; ++q) {
          most[static_cast<size_t>(q)] = std::max(most[static_cast<size_t>(q)], here[q]);
        }
      }
      for (Eigen::Index q = 0; q < rows; ++q) {
        const float enough = best[static_cast<size_t>(q)] - slack_;
        if (most[static_cast<size_t>(q)] < enough) {
          continue;
        }
        for (Eigen::Index t = start; t < end; ++t) {
          if (tile_best[static_cast<size_t>(t * count + q)] >= enough) {
            compare(first + q, t, least[static_cast<size_t>(q)], nearest[first + q]);
          }
        }
      }
    }
  }

  void compare(Eigen::Index query, Eigen::Index tile, double& least, int& nearest) const {
    const Eigen::Index begin = tile * tiles_.height;
    const Eigen::Index end = std::min(points_.rows(), begin + tiles_.height);
    for (Eigen::Index i = begin; i < end; ++i) {
      const double away = (queries_.row(query) - points_.row(i)).squaredNorm();
      if (away < least) {
        least = away;
        nearest = static_cast<int>(i);
      }
    }
  }

  const RowMatrix<double>& queries_;
  const RowMatrix<double>& points_;
  double scale_;
  Kernel kernel_;
  Tiles tiles_;
  float slack_ = 0.0F;
};

double largest_norm(const RowMatrix<double>& rows) {
  return rows.size() == 0 ? 0.0 : rows.rowwise().norm().maxCoeff<Eigen::PropagateNaN>();
}

}  // namespace

Eigen::VectorXi nearest_rows(const RowMatrix<double>& queries, const RowMatrix<double>& points,
                             ProgressRange progress) {
  if (queries.cols() != points.cols() || points.rows() == 0) {
    throw Error(ErrorCode::wrong_shape,
                "The nearest of " + std::to_string(points.rows()) + " rows of " +
                    std::to_string(points.cols()) + " numbers is looked for, to rows of " +
                    std::to_string(queries.cols()) + "; there must be one, of as many.");
  }
  const double query_size = largest_norm(queries), point_size = largest_norm(points);
  if (!std::isfinite(query_size) || !std::isfinite(point_size)) {
    throw Error(ErrorCode::not_finite,
                "The rows to compare hold NaN or infinity. Check the functions and the map.");
  }
  progress.report(0.0);
  const double size = std::max(query_size, point_size);
  const Search search(queries, points, size > 0.0 ? 1.0 / size : 1.0);
  Eigen::VectorXi nearest(queries.rows());
  const Eigen::Index blocks = (queries.rows() + kQueries - 1) / kQueries;
  const int threads = omp_in_parallel() ? 1 : omp_get_max_threads();
  const Eigen::Index together = kBlocksBetweenReports * threads;
  for (Eigen::Index start = 0; start < blocks; start += together) {
    const Eigen::Index end = std::min(blocks, start + together);
    std::atomic<bool> no_memory{false};  // nothing may be thrown out of the loop
#pragma omp parallel for schedule(dynamic, 1) num_threads(threads) if (threads > 1)
    for (Eigen::Index b = start; b < end; ++b) {
      try {
        search(b * kQueries, nearest);
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
