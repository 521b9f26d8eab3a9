// SPDX-License-Identifier: GPL-3.0-or-later
#include "multiresolution.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "block_krylov.h"
#include "copies.h"
#include "supple/core/dense.h"
#include "supple/core/tall.h"

namespace supple {
namespace {

// Coarsening stops at this many rows, where the exact method takes about a second.
constexpr Eigen::Index kCoarseRows = 50000;
// A few are enough, but where the last wanted value and the first left out are near each other.
constexpr int kMaxCorrections = 40;
// Of the coarse functions, the lower part is near fine ones: the coarse space has to have this many
// times the dimensions that are wanted.
constexpr Eigen::Index kRoom = 4;
// The coarse values' errors: copies of one eigenvalue can be so far apart.
constexpr double kCoarseTolerance = 1e-3, kCoarseSame = 1e-2;

// Each row's aggregate: first every row whose neighbours are all free gathers them, then the rest
// joins a neighbour's. No aggregate crosses components.
Eigen::VectorXi aggregates(const SparseMatrix& matrix, Eigen::Index& count) {
  const Eigen::Index n = matrix.rows();
  Eigen::VectorXi aggregate = Eigen::VectorXi::Constant(n, -1);
  int next = 0;
  for (int i = 0; i < n; ++i) {
    bool free = aggregate[i] < 0;
    for (SparseMatrix::InnerIterator it(matrix, i); free && it; ++it) {
      free = aggregate[it.row()] < 0;
    }
    if (free) {
      for (SparseMatrix::InnerIterator it(matrix, i); it; ++it) {
        aggregate[it.row()] = next;
      }
      aggregate[i] = next++;
    }
  }
  Eigen::VectorXi joined = aggregate;
  for (int i = 0; i < n; ++i) {
    if (aggregate[i] >= 0) {
      continue;
    }
    double strongest = -1.0;
    for (SparseMatrix::InnerIterator it(matrix, i); it; ++it) {
      if (aggregate[it.row()] >= 0 && -it.value() > strongest) {
        strongest = -it.value();
        joined[i] = aggregate[it.row()];
      }
    }
    if (joined[i] < 0) {  // only obtuse corners around it
      for (SparseMatrix::InnerIterator it(matrix, i); it && joined[i] < 0; ++it) {
        joined[i] = aggregate[it.row()];
      }
    }
    if (joined[i] < 0) {
      joined[i] = next++;
    }
  }
  count = next;
  return joined;
}

struct Level {
  SparseMatrix laplacian;
  Eigen::VectorXd mass;
  SparseMatrix prolongation;  // from this level to the finer one
};

// One step of smoothed aggregation.
Level coarser(const SparseMatrix& laplacian, const Eigen::VectorXd& mass) {
  Eigen::Index count = 0;
  const Eigen::VectorXi aggregate = aggregates(laplacian, count);
  SparseMatrix constant(laplacian.rows(), count);
  std::vector<Eigen::Triplet<double>> ones;
  ones.reserve(static_cast<size_t>(laplacian.rows()));
  for (int i = 0; i < aggregate.size(); ++i) {
    ones.emplace_back(i, aggregate[i], 1.0);
  }
  constant.setFromTriplets(ones.begin(), ones.end());
  // Jacobi with 2 / 3 damps the upper part of the spectrum; a row whose diagonal a sliver has
  // spoilt is left as it is. Rows still sum to 1: constants stay exact.
  const Eigen::VectorXd diagonal = laplacian.diagonal();
  const Eigen::VectorXd damping =
      diagonal.unaryExpr([](double d) { return d > 0.0 ? 2.0 / 3.0 / d : 0.0; });
  Level level;
  level.prolongation = constant - SparseMatrix(damping.asDiagonal() * (laplacian * constant));
  const SparseMatrix transposed = level.prolongation.transpose();
  level.laplacian = transposed * SparseMatrix(laplacian * level.prolongation);
  level.mass = constant.transpose() * mass;  // lumped: only a guess is wanted
  return level;
}

// x = D^1/2 P D_c^-1/2 x_c, from the coarsest level to the finest.
RowMatrix<double> prolonged(const std::vector<Level>& levels, RowMatrix<double> x,
                            const Eigen::VectorXd& fine_root_mass) {
  x = levels.back().mass.cwiseSqrt().cwiseInverse().asDiagonal() * x;
  for (auto level = levels.rbegin(); level != levels.rend(); ++level) {
    x = SparseRowMatrix(level->prolongation) * x;
  }
  return fine_root_mass.asDiagonal() * x;
}

// (S + shift)^-1 x, some columns at a time: the factor's panels need copies.
RowMatrix<double> inverse(const Eigenproblem& problem, const RowMatrix<double>& x) {
  constexpr Eigen::Index kTogether = 32;
  RowMatrix<double> y(x.rows(), x.cols());
  for (Eigen::Index first = 0; first < x.cols(); first += kTogether) {
    const Eigen::Index count = std::min(kTogether, x.cols() - first);
    RowMatrix<double> part = problem.inverse(x.middleCols(first, count));
    problem.leave_kernel(part);
    y.middleCols(first, count) = part;
  }
  return y;
}

// One inverse iteration and the Ritz pairs of S + shift =: A in its span: with Y = A^-1 X,
// Y^T A Y = X^T Y. Returns the values of S; x becomes orthonormal.
Eigen::VectorXd correct(const Eigenproblem& problem, RowMatrix<double>& x) {
  RowMatrix<double> y = inverse(problem, x);
  Eigen::MatrixXd energy = tall_product<double>({x}, y), gram = tall_product<double>({y}, y);
  energy = (0.5 * (energy + energy.transpose())).eval();
  // energy u = mu gram u, by the square root of the Gram matrix.
  const Eigen::VectorXd size = symmetric_eigen(gram);
  const Eigen::MatrixXd root =
      gram * size.cwiseMax(1e-14 * size.maxCoeff()).cwiseSqrt().cwiseInverse().asDiagonal();
  Eigen::MatrixXd small = root.transpose() * energy * root;
  const Eigen::VectorXd values = symmetric_eigen(small);
  x.setZero();
  add_tall_product<double>(1.0, {y}, root * small, x);
  return values.array() - problem.shift();
}

}  // namespace

Pairs multiresolution(const Eigenproblem& problem, Eigen::Index count, double residual,
                      const ProgressRange& progress) {
  std::vector<Level> levels;
  levels.push_back(coarser(problem.laplacian(), problem.mass()));
  while (levels.back().mass.size() > kCoarseRows) {
    levels.push_back(coarser(levels.back().laplacian, levels.back().mass));
    if (levels.back().mass.size() * 10 > levels[levels.size() - 2].mass.size() * 9) {
      break;  // nothing left to join: many small pieces
    }
  }
  progress.report(0.2);
  // Half as many more than wanted: an error along the next function left out goes by the ratio of
  // its value to theirs, 2 / 3, at each correction.
  const Eigen::Index space = count + std::max<Eigen::Index>(8, count / 2);
  Pairs pairs;
  {
    const Eigenproblem coarse(levels.back().laplacian, levels.back().mass, nullptr);
    if (coarse.size() - coarse.kernel_size() < kRoom * space + 64) {
      return {Eigen::VectorXd(0), RowMatrix<double>(problem.size(), 0)};
    }
    const ProgressRange work = progress.stage("coarse eigenbasis", 0.2, 0.4);
    pairs = with_all_copies(
        coarse, space, block_width(space), kCoarseSame,
        [&](const RowMatrix<double>& locked, Eigen::Index wanted, uint64_t seed) {
          return block_krylov(
              coarse, locked,
              {.count = wanted, .tolerance = kCoarseTolerance, .max_restarts = 20, .seed = seed},
              work);
        });
  }
  count = std::min(count, pairs.size());
  pairs.vectors = prolonged(levels, std::move(pairs.vectors), problem.root_mass());
  problem.leave_kernel(pairs.vectors);
  levels.clear();

  double reached = std::numeric_limits<double>::infinity();
  for (int correction = 0; correction < kMaxCorrections; ++correction) {
    progress.report(1.0 - 0.6 * std::pow(0.7, correction));
    pairs.values = correct(problem, pairs.vectors);
    reached = problem.residuals(pairs).head(count).maxCoeff();
    if (reached <= std::max(residual, problem.rounding_floor())) {
      break;
    }
  }
  pairs.values.conservativeResize(count);
  pairs.vectors = pairs.vectors.leftCols(count).eval();
  return pairs;
}

}  // namespace supple
