// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/spectral/functional_map.h"

#include <omp.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "supple/core/dense.h"
#include "supple/core/error.h"
#include "supple/core/simd.h"
#include "supple/core/tall.h"

namespace supple {
namespace {

// Queries and points whose products are made at once: they stay in the second-level cache.
constexpr Eigen::Index kQueries = 128;
constexpr Eigen::Index kPoints = 1024;
// Blocks of queries between two looks at the progress, a thread.
constexpr Eigen::Index kBlocksBetweenReports = 4;

// The largest of count > 0 numbers.
template <int Bytes>
SUPPLE_INLINE float largest_body(const float* values, Eigen::Index count) {
  using V = typename Lanes<float, Bytes>::type;
  constexpr int lanes = Lanes<float, Bytes>::count;
  float most = values[0];
  Eigen::Index i = 0;
  if (count >= 2 * lanes) {
    typedef V Unaligned __attribute__((aligned(4), may_alias));
    V a = *reinterpret_cast<const Unaligned*>(values);
    V b = *reinterpret_cast<const Unaligned*>(values + lanes);
    for (i = 2 * lanes; i + 2 * lanes <= count; i += 2 * lanes) {
      const V c = *reinterpret_cast<const Unaligned*>(values + i);
      const V d = *reinterpret_cast<const Unaligned*>(values + i + lanes);
      a = c > a ? c : a;
      b = d > b ? d : b;
    }
    for (int lane = 0; lane < lanes; ++lane) {
      most = std::max(most, std::max(a[lane], b[lane]));
    }
  }
  for (; i < count; ++i) {
    most = std::max(most, values[i]);
  }
  return most;
}
SUPPLE_AVX512 float largest_avx512(const float* values, Eigen::Index count) {
  return largest_body<64>(values, count);
}
SUPPLE_AVX2 float largest_avx2(const float* values, Eigen::Index count) {
  return largest_body<32>(values, count);
}
float largest_plain(const float* values, Eigen::Index count) {
  return largest_body<16>(values, count);
}
using Largest = float (*)(const float*, Eigen::Index);

// A point that may be the nearest, and its score x . y - |y|^2 / 2 in single precision.
struct Candidate {
  int index;
  float score;
};

// Adds the points of a block that may be nearest: those whose score is at most `slack` below the
// best so far.
void collect(const float* scores, Eigen::Index count, int first, float slack, Largest largest,
             float& best, std::vector<Candidate>& candidates) {
  const float here = largest(scores, count);
  if (here < best - slack) {
    return;
  }
  best = std::max(best, here);
  for (Eigen::Index i = 0; i < count; ++i) {
    if (scores[i] >= best - slack) {
      candidates.push_back({first + static_cast<int>(i), scores[i]});
    }
  }
}

// Points in blocks, single precision, with -|y|^2 / 2 as one more column.
std::vector<RowMatrix<float>> blocks_of(const RowMatrix<double>& points, double scale) {
  std::vector<RowMatrix<float>> blocks;
  for (Eigen::Index i = 0; i < points.rows(); i += kPoints) {
    const Eigen::Index rows = std::min(kPoints, points.rows() - i);
    const RowMatrix<double> scaled = scale * points.middleRows(i, rows);
    RowMatrix<float> block(rows, points.cols() + 1);
    block.leftCols(points.cols()) = scaled.cast<float>();
    block.rightCols(1) = (-0.5 * scaled.rowwise().squaredNorm()).cast<float>();
    blocks.push_back(std::move(block));
  }
  return blocks;
}

// One block of queries against all points.
class Search {
 public:
  Search(const RowMatrix<double>& queries, const RowMatrix<double>& points, double scale)
      : queries_(queries),
        points_(points),
        scale_(scale),
        blocks_(blocks_of(points, scale)),
        largest_(best_kernel<Largest>(largest_avx512, largest_avx2, largest_plain)) {
    // Norms are at most 1. k + 1 products and sums, each operand rounded once before.
    const double rounding = static_cast<double>(points.cols() + 8) * 0x1.0p-23;
    slack_ = static_cast<float>(2.0 * rounding * 1.5);
  }

  void operator()(Eigen::Index first, Eigen::VectorXi& nearest) const {
    const Eigen::Index rows = std::min(kQueries, queries_.rows() - first), k = queries_.cols();
    RowMatrix<float> block(rows, k + 1), scores;
    block.leftCols(k) = (scale_ * queries_.middleRows(first, rows)).cast<float>();
    block.rightCols(1).setOnes();
    std::vector<std::vector<Candidate>> candidates(static_cast<size_t>(rows));
    std::vector<float> best(static_cast<size_t>(rows), -std::numeric_limits<float>::infinity());
    int point = 0;
    for (const RowMatrix<float>& others : blocks_) {
      gemm(1.0F, block, Op::none, others, Op::transpose, 0.0F, scores);
      for (Eigen::Index i = 0; i < rows; ++i) {
        const auto row = static_cast<size_t>(i);
        collect(scores.row(i).data(), others.rows(), point, slack_, largest_, best[row],
                candidates[row]);
      }
      point += static_cast<int>(others.rows());
    }
    for (Eigen::Index i = 0; i < rows; ++i) {
      const auto row = static_cast<size_t>(i);
      nearest[first + i] = nearest_of(candidates[row], best[row], first + i);
    }
  }

 private:
  // Candidates come in ascending order, so that the first of equals stays.
  int nearest_of(const std::vector<Candidate>& candidates, float best, Eigen::Index query) const {
    int nearest = 0;
    double least = std::numeric_limits<double>::infinity();
    for (const Candidate& candidate : candidates) {
      if (candidate.score < best - slack_) {
        continue;
      }
      const double away = (queries_.row(query) - points_.row(candidate.index)).squaredNorm();
      if (away < least) {
        least = away;
        nearest = candidate.index;
      }
    }
    return nearest;
  }

  const RowMatrix<double>& queries_;
  const RowMatrix<double>& points_;
  double scale_;
  float slack_ = 0.0F;
  std::vector<RowMatrix<float>> blocks_;
  Largest largest_;
};

double largest_norm(const RowMatrix<double>& rows) {
  return rows.size() == 0 ? 0.0 : rows.rowwise().norm().maxCoeff<Eigen::PropagateNaN>();
}

void check_count(const char* whose, const Eigenbasis& basis, Eigen::Index count) {
  if (count < 1 || count > basis.functions.cols()) {
    throw Error(ErrorCode::bad_option, std::to_string(count) + " functions of the " + whose +
                                           " are asked for; there are " +
                                           std::to_string(basis.functions.cols()) +
                                           ", and at least 1 is needed.");
  }
}

void check_basis(const char* whose, const Eigenbasis& basis) {
  if (basis.functions.rows() != basis.mass.size()) {
    throw Error(ErrorCode::wrong_shape, "The functions of the " + std::string(whose) + " have " +
                                            std::to_string(basis.functions.rows()) +
                                            " rows, its masses " +
                                            std::to_string(basis.mass.size()) + ".");
  }
}

void check_map(const Eigenbasis& source, const Eigenbasis& target, const Eigen::VectorXi& map) {
  if (map.size() != source.mass.size()) {
    throw Error(ErrorCode::wrong_shape, "The point map has " + std::to_string(map.size()) +
                                            " entries for " + std::to_string(source.mass.size()) +
                                            " source vertices.");
  }
  for (Eigen::Index i = 0; i < map.size(); ++i) {
    if (map[i] < 0 || map[i] >= target.mass.size()) {
      throw Error(ErrorCode::index_out_of_range,
                  "Entry " + std::to_string(i) + " of the point map is " + std::to_string(map[i]) +
                      "; the target has " + std::to_string(target.mass.size()) + " vertices.");
    }
  }
}

// The first functions, of a surface of area 1.
RowMatrix<double> unit_functions(const Eigenbasis& basis, Eigen::Index count) {
  return std::sqrt(basis.mass.sum()) * basis.functions.leftCols(count);
}

}  // namespace

RowMatrix<double> functional_map(const Eigenbasis& source, const Eigenbasis& target,
                                 const Eigen::VectorXi& point_map, Eigen::Index source_count,
                                 Eigen::Index target_count) {
  check_basis("source", source);
  check_basis("target", target);
  check_count("source", source, source_count);
  check_count("target", target, target_count);
  check_map(source, target, point_map);
  RowMatrix<double> pulled(point_map.size(), target_count);
  const double scale = std::sqrt(target.mass.sum() / source.mass.sum());
  for (Eigen::Index i = 0; i < point_map.size(); ++i) {
    pulled.row(i) = scale * source.mass[i] * target.functions.row(point_map[i]).head(target_count);
  }
  return tall_product<double>({source.functions.leftCols(source_count)}, pulled);
}

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

Eigen::VectorXi point_map(const Eigenbasis& source, const Eigenbasis& target,
                          const RowMatrix<double>& map, ProgressRange progress) {
  check_basis("source", source);
  check_basis("target", target);
  check_count("source", source, map.rows());
  check_count("target", target, map.cols());
  const RowMatrix<double> moved =
      product(unit_functions(target, map.cols()), Op::none, map, Op::transpose);
  return nearest_rows(unit_functions(source, map.rows()), moved, progress);
}

Zoomout zoomout(const Eigenbasis& source, const Eigenbasis& target, const Eigen::VectorXi& initial,
                const ZoomoutOptions& options, ProgressRange progress) {
  if (options.from < 1 || options.to < options.from || options.step < 1) {
    throw Error(ErrorCode::bad_option,
                "A map can't be refined from " + std::to_string(options.from) + " to " +
                    std::to_string(options.to) + " functions by " + std::to_string(options.step) +
                    ": from and step must be 1 or more, and to no less than from.");
  }
  check_count("source", source, options.to);
  check_count("target", target, options.to);
  const int rounds = 1 + (options.to - options.from + options.step - 1) / options.step;
  Zoomout result{initial, {}};
  for (int round = 0; round < rounds; ++round) {
    const int count = std::min(options.from + round * options.step, options.to);
    const ProgressRange part = progress.stage(
        "refining the map with " + std::to_string(count) + " functions",
        static_cast<double>(round) / rounds, static_cast<double>(round + 1) / rounds);
    result.functional_map = functional_map(source, target, result.point_map, count, count);
    result.point_map = point_map(source, target, result.functional_map, part);
  }
  return result;
}

}  // namespace supple
