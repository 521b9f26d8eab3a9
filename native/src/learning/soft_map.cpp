// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/soft_map.h"

#include <omp.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <string>

#include "soft_weights.h"
#include "supple/core/dense.h"
#include "supple/core/error.h"
#include "supple/core/nearest_rows.h"
#include "supple/core/parallel.h"

namespace supple {
namespace {

// Rows of either surface in a tile, at most: what is made of it stays in the second-level cache
// from one step to the next, and BLAS is near its best.
constexpr Eigen::Index kTileRows = 512;
// Weights of at least e^-kReach leave room for what they are divided by and multiplied with.
template <class Scalar>
constexpr double kReach = sizeof(Scalar) == sizeof(float) ? 60.0 : 600.0;

template <class Scalar>
using Tiles = std::vector<RowMatrix<Scalar>>;

Eigen::Index tile_begin(Eigen::Index rows, size_t tile, size_t count) {
  return rows * static_cast<Eigen::Index>(tile) / static_cast<Eigen::Index>(count);
}

template <class Scalar>
Tiles<Scalar> cut(const RowMatrix<Scalar>& matrix, size_t count) {
  Tiles<Scalar> tiles(count);
  for (size_t t = 0; t < count; ++t) {
    const Eigen::Index begin = tile_begin(matrix.rows(), t, count);
    tiles[t] = matrix.middleRows(begin, tile_begin(matrix.rows(), t + 1, count) - begin);
  }
  return tiles;
}

template <class Scalar>
RowMatrix<Scalar> join(const Tiles<Scalar>& tiles) {
  Eigen::Index rows = 0;
  for (const RowMatrix<Scalar>& tile : tiles) {
    rows += tile.rows();
  }
  RowMatrix<Scalar> matrix(rows, tiles.front().cols());
  Eigen::Index begin = 0;
  for (const RowMatrix<Scalar>& tile : tiles) {
    matrix.middleRows(begin, tile.rows()) = tile;
    begin += tile.rows();
  }
  return matrix;
}

// As many rows as the tiles have.
template <class Scalar>
Tiles<Scalar> constant_like(const Tiles<Scalar>& tiles, Eigen::Index cols, Scalar value) {
  Tiles<Scalar> result(tiles.size());
  for (size_t t = 0; t < tiles.size(); ++t) {
    result[t].setConstant(tiles[t].rows(), cols, value);
  }
  return result;
}

// The sum of what each thread has, in order.
template <class Scalar>
Tiles<Scalar> sum_of(std::vector<Tiles<Scalar>> parts) {
  for (size_t part = 1; part < parts.size(); ++part) {
    for (size_t t = 0; t < parts[part].size(); ++t) {
      parts[0][t] += parts[part][t];
    }
  }
  return std::move(parts[0]);
}

template <class Scalar>
void add_product(const RowMatrix<Scalar>& a, Op op_a, const RowMatrix<Scalar>& b,
                 RowMatrix<Scalar>& sum) {
  gemm(Scalar(1), a, op_a, b, Op::none, Scalar(1), sum);
}

// [a | b]
template <class A, class B>
RowMatrix<typename A::Scalar> beside(const A& a, const B& b) {
  RowMatrix<typename A::Scalar> both(a.rows(), a.cols() + b.cols());
  both << a, b;
  return both;
}

// [X | 1]: weights times it are what they pull back, and their sums.
template <class Scalar>
RowMatrix<Scalar> with_ones(const RowMatrix<Scalar>& values) {
  return beside(values, RowMatrix<Scalar>::Ones(values.rows(), 1));
}

template <class Scalar>
Eigen::VectorXd row_lengths(const RowMatrix<Scalar>& features, const char* whose) {
  Eigen::VectorXd lengths(features.rows());
  for (Eigen::Index i = 0; i < features.rows(); ++i) {
    lengths[i] = features.row(i).template cast<double>().stableNorm();
    if (!std::isfinite(lengths[i]) || lengths[i] == 0.0) {
      throw Error(ErrorCode::not_finite,
                  "Row " + std::to_string(i) + " of the " + whose + " surface's features " +
                      (lengths[i] == 0.0 ? "is 0 and has no direction"
                                         : "holds NaN or infinity, or is too long") +
                      ". Check the feature extractor.");
    }
  }
  return lengths;
}

// From the gradient with respect to rows of length 1 to that with respect to what they were.
template <class Scalar>
RowMatrix<Scalar> through_division(const RowMatrix<Scalar>& unit, const Eigen::VectorXd& lengths,
                                   RowMatrix<Scalar> grad) {
#pragma omp parallel for schedule(static)
  for (Eigen::Index i = 0; i < grad.rows(); ++i) {
    grad.row(i) = (grad.row(i) - unit.row(i) * unit.row(i).dot(grad.row(i))) /
                  static_cast<Scalar>(lengths[i]);
  }
  return grad;
}

template <class Matrix>
void check_shape(const Matrix& matrix, Eigen::Index rows, Eigen::Index cols, const char* what,
                 size_t surface) {
  if (matrix.rows() != rows || matrix.cols() != cols) {
    throw Error(ErrorCode::wrong_shape,
                std::string(what) + " surface " + std::to_string(surface) + " are " +
                    std::to_string(matrix.rows()) + " x " + std::to_string(matrix.cols()) + "; " +
                    std::to_string(rows) + " x " + std::to_string(cols) + " are needed.");
  }
}

}  // namespace

template <class Scalar>
struct SoftMapPair<Scalar>::Tile {
  size_t part, row, col;  // which thread, which tiles of surfaces 0 and 1
  RowMatrix<Scalar> products, weights, slopes;
};

template <class Scalar>
SoftMapPair<Scalar>::SoftMapPair(const RowMatrix<Scalar>& first, const RowMatrix<Scalar>& second,
                                 double temperature, ProgressRange progress) {
  if (first.cols() != second.cols() || first.size() == 0 || second.size() == 0) {
    throw Error(ErrorCode::wrong_shape,
                "A soft map needs as many features of both surfaces, at least one; these are " +
                    std::to_string(first.rows()) + " x " + std::to_string(first.cols()) + " and " +
                    std::to_string(second.rows()) + " x " + std::to_string(second.cols()) + ".");
  }
  if (!std::isfinite(temperature) || temperature <= 0.0) {
    throw Error(ErrorCode::bad_option, "The temperature of a soft map is " +
                                           std::to_string(temperature) +
                                           "; it must be a number above 0.");
  }
  // Two products that differ at all differ by far more than the least of a type.
  using Limits = std::numeric_limits<Scalar>;
  temperature_ = static_cast<Scalar>(std::clamp<double>(
      temperature, static_cast<double>(Limits::min()), static_cast<double>(Limits::max())));
  one_weight_ = 2.0 / temperature <= kReach<Scalar>;
  for (size_t s = 0; s < 2; ++s) {
    const RowMatrix<Scalar>& features = s == 0 ? first : second;
    lengths_[s] = row_lengths(features, s == 0 ? "first" : "second");
    const RowMatrix<Scalar> unit =
        (lengths_[s].cwiseInverse().asDiagonal() * features.template cast<double>())
            .template cast<Scalar>();
    // As many for each thread, so that none waits for another.
    const Eigen::Index each = s == 0 ? thread_count() : 1;
    const Eigen::Index count = (unit.rows() + each * kTileRows - 1) / (each * kTileRows);
    features_[s] = cut(unit, static_cast<size_t>(std::min(count * each, unit.rows())));
  }
  if (!one_weight_) {
    find_largest(progress);
  }
}

template <class Scalar>
size_t SoftMapPair<Scalar>::parts() const {
  return omp_in_parallel() ? 1 : std::min(static_cast<size_t>(thread_count()), features_[0].size());
}

// Calls step(tile) for each tile of the products. Those of a part come one after the other.
template <class Scalar>
template <class Step>
void SoftMapPair<Scalar>::over_tiles(const ProgressRange& progress, const Step& step) const {
  const size_t rows = features_[0].size(), cols = features_[1].size(), count = parts();
  std::atomic<size_t> done = 0;
  run_at_once(count, [&](size_t part) {
    Tile tile;
    tile.part = part;
    for (tile.row = rows * part / count; tile.row < rows * (part + 1) / count; ++tile.row) {
      for (tile.col = 0; tile.col < cols; ++tile.col) {
        progress.report(static_cast<double>(done++) / static_cast<double>(rows * cols));
        gemm(Scalar(1), features_[0][tile.row], Op::none, features_[1][tile.col], Op::transpose,
             Scalar(0), tile.products);
        step(tile);
      }
    }
  });
  progress.report(1.0);
}

template <class Scalar>
void SoftMapPair<Scalar>::find_largest(const ProgressRange& progress) {
  const Scalar none = std::numeric_limits<Scalar>::lowest();
  largest_[0] = constant_like(features_[0], 1, none);
  std::vector<Tiles> across(parts(), constant_like(features_[1], 1, none));
  over_tiles(progress, [&](const Tile& tile) {
    RowMatrix<Scalar>& row = largest_[0][tile.row];
    RowMatrix<Scalar>& col = across[tile.part][tile.col];
    row = row.cwiseMax(tile.products.rowwise().maxCoeff()).eval();
    col = col.cwiseMax(tile.products.colwise().maxCoeff().transpose()).eval();
  });
  largest_[1] = std::move(across[0]);
  for (size_t part = 1; part < across.size(); ++part) {
    for (size_t t = 0; t < largest_[1].size(); ++t) {
      largest_[1][t] = largest_[1][t].cwiseMax(across[part][t]).eval();
    }
  }
}

// P_0 before its rows are divided by their sums, or P_1^T before its columns are.
template <class Scalar>
void SoftMapPair<Scalar>::weigh(Tile& tile, size_t direction) const {
  RowMatrix<Scalar>& weights = tile.weights;
  if (one_weight_) {
    weights.resizeLike(tile.products);
    soft_weights(tile.products.data(), tile.products.size(), Scalar(1), temperature_,
                 weights.data());
    return;
  }
  if (direction == 0) {
    weights = tile.products.colwise() - largest_[0][tile.row].col(0);
  } else {
    weights = tile.products.rowwise() - largest_[1][tile.col].col(0).transpose();
  }
  soft_weights(weights.data(), weights.size(), Scalar(0), temperature_, weights.data());
}

template <class Scalar>
auto SoftMapPair<Scalar>::apply(const Both& values, ProgressRange progress) const
    -> std::array<Pulled, 2> {
  std::array<bool, 2> wanted;
  std::array<Tiles, 2> carried;
  for (size_t s = 0; s < 2; ++s) {
    wanted[1 - s] = values[s].rows() > 0;
    if (wanted[1 - s]) {
      check_shape(values[s], rows(s), values[s].cols(), "The values of", s);
      carried[s] = cut(with_ones(values[s]), features_[s].size());
    }
  }
  if (!wanted[0] && !wanted[1]) {
    throw Error(ErrorCode::wrong_shape,
                "Nothing is to be pulled back: the values of both surfaces have 0 rows.");
  }
  Tiles down;
  std::vector<Tiles> across(parts());
  if (wanted[0]) {
    down = constant_like(features_[0], values[1].cols() + 1, Scalar(0));
  }
  if (wanted[1]) {
    across.assign(parts(), constant_like(features_[1], values[0].cols() + 1, Scalar(0)));
  }
  over_tiles(progress, [&](Tile& tile) {
    if (wanted[0]) {
      weigh(tile, 0);
      add_product(tile.weights, Op::none, carried[1][tile.col], down[tile.row]);
    }
    if (wanted[1]) {
      if (!wanted[0] || !one_weight_) {
        weigh(tile, 1);
      }
      add_product(tile.weights, Op::transpose, carried[0][tile.row], across[tile.part][tile.col]);
    }
  });
  std::array<Pulled, 2> pulled;
  for (size_t d = 0; d < 2; ++d) {
    if (wanted[d]) {
      const RowMatrix<Scalar> sums = join(d == 0 ? down : sum_of(std::move(across)));
      const Eigen::Index k = sums.cols() - 1;
      pulled[d].sums = sums.col(k);
      pulled[d].values = sums.leftCols(k).array().colwise() / pulled[d].sums.array();
    }
  }
  return pulled;
}

// The gradient with respect to the products S, direction 0: with E the weights, R their rows' sums,
// G the gradient with respect to P X and m_i = (P X)_i . G_i,
//   E o (G X^T - m 1^T) / (R t) = E o [G / (R t) | -m / (R t)] [X | 1]^T.
// Direction 1 is the same with E transposed; where both have one E, their two products are one.
template <class Scalar>
auto SoftMapPair<Scalar>::backward(const Both& values, const std::array<Pulled, 2>& pulled,
                                   const Both& grad, ProgressRange progress) const -> Both {
  struct Term {
    size_t direction;
    Both sides;  // at surfaces 0 and 1
  };
  std::vector<Term> terms;
  for (size_t d = 0; d < 2; ++d) {
    if (grad[d].rows() == 0) {
      continue;
    }
    const RowMatrix<Scalar>& x = values[1 - d];
    check_shape(x, rows(1 - d), x.cols(), "The values of", 1 - d);
    check_shape(grad[d], rows(d), x.cols(), "The gradients of what was pulled back to", d);
    check_shape(pulled[d].values, rows(d), x.cols(), "The values pulled back to", d);
    check_shape(pulled[d].sums, rows(d), 1, "The sums of weights of", d);
    const Vector mean = grad[d].cwiseProduct(pulled[d].values).rowwise().sum();
    const Vector factor = (pulled[d].sums * temperature_).cwiseInverse();
    Term term{d, {}};
    term.sides[d] = factor.asDiagonal() * beside(grad[d], -mean);
    term.sides[1 - d] = with_ones(x);
    if (one_weight_ && !terms.empty()) {
      for (size_t s = 0; s < 2; ++s) {
        terms[0].sides[s] = beside(terms[0].sides[s], term.sides[s]);
      }
    } else {
      terms.push_back(std::move(term));
    }
  }
  std::vector<std::array<Tiles, 2>> sides;
  for (const Term& term : terms) {
    sides.push_back(
        {cut(term.sides[0], features_[0].size()), cut(term.sides[1], features_[1].size())});
  }
  const Eigen::Index c = features_[0][0].cols();
  Tiles down = constant_like(features_[0], c, Scalar(0));
  std::vector<Tiles> across(parts(), constant_like(features_[1], c, Scalar(0)));
  if (!terms.empty()) {
    over_tiles(progress, [&](Tile& tile) {
      for (size_t i = 0; i < terms.size(); ++i) {
        weigh(tile, terms[i].direction);
        gemm(Scalar(1), sides[i][0][tile.row], Op::none, sides[i][1][tile.col], Op::transpose,
             Scalar(0), tile.slopes);
        tile.slopes.array() *= tile.weights.array();
        add_product(tile.slopes, Op::none, features_[1][tile.col], down[tile.row]);
        add_product(tile.slopes, Op::transpose, features_[0][tile.row],
                    across[tile.part][tile.col]);
      }
    });
  }
  return {through_division(join(features_[0]), lengths_[0], join(down)),
          through_division(join(features_[1]), lengths_[1], join(sum_of(std::move(across))))};
}

template <class Scalar>
Eigen::VectorXi SoftMapPair<Scalar>::hard_map(size_t direction, ProgressRange progress) const {
  // The nearest of length 1 has the largest product.
  return nearest_rows(join(features_[direction]).template cast<double>(),
                      join(features_[1 - direction]).template cast<double>(), progress);
}

template class SoftMapPair<float>;
template class SoftMapPair<double>;

}  // namespace supple
