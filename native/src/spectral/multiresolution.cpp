// SPDX-License-Identifier: GPL-3.0-or-later
#include "multiresolution.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "block_krylov.h"
#include "coarse_space.h"
#include "copies.h"
#include "supple/core/dense.h"
#include "supple/core/parallel.h"
#include "supple/core/tall.h"

namespace supple {
namespace {

// A few are enough, but where the last wanted value and the first left out are near each other.
constexpr int kMaxCorrections = 40;
// Of the coarse functions only the lower part is near fine ones: above it the lumped mass makes
// others too low. The coarse space has to have this many times the dimensions that are wanted, and
// the coarser one of two rings so many.
constexpr Eigen::Index kRoom = 20, kAmple = 40;
// The coarse values' errors: copies of one eigenvalue can be so far apart.
constexpr double kCoarseTolerance = 1e-3, kCoarseSame = 1e-2;

// x = D^1/2 P D_c^-1/2 x_c.
RowMatrix<double> prolonged(const CoarseSpace& coarse, const RowMatrix<double>& x,
                            const Eigen::VectorXd& fine_root_mass) {
  const Eigen::VectorXd inverse_root = coarse.mass.cwiseSqrt().cwiseInverse();
  RowMatrix<double> finer(coarse.prolongation.rows(), x.cols());
#pragma omp parallel for schedule(static)
  for (Eigen::Index i = 0; i < finer.rows(); ++i) {
    finer.row(i).setZero();
    for (SparseRowMatrix::InnerIterator it(coarse.prolongation, i); it; ++it) {
      finer.row(i) += fine_root_mass[i] * it.value() * inverse_root[it.col()] * x.row(it.col());
    }
  }
  return finer;
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
  Eigen::MatrixXd small;
  Eigen::VectorXd values;
  {
    const SingleThread alone;  // Eigen's threads would change the order of the sums
    small = root.transpose() * energy * root;
    values = symmetric_eigen(small);
  }
  x.setZero();
  add_tall_product<double>(1.0, {y}, root * small, x);
  return values.array() - problem.shift();
}

}  // namespace

Pairs multiresolution(const Eigenproblem& problem, Eigen::Index count, double residual,
                      const ProgressRange& progress) {
  // Some more than wanted: an error along the next function left out goes by the ratio of the last
  // wanted value to its own at each correction.
  const Eigen::Index space = count + std::max<Eigen::Index>(8, count / 8);
  const Eigen::Index all = space + problem.kernel_size();
  const Pairs none{Eigen::VectorXd(0), RowMatrix<double>(problem.size(), 0)};
  if (problem.size() < 4 * kRoom * all) {  // a region of one ring has four vertices or more
    return none;
  }
  CoarseSpace level = coarse_space(problem.laplacian(), problem.mass(), 2);
  if (level.mass.size() < kAmple * all) {
    progress.report(0.1);
    level = coarse_space(problem.laplacian(), problem.mass(), 1);
  }
  if (level.mass.size() < kRoom * all) {
    return none;
  }
  progress.report(0.2);
  Pairs pairs;
  {
    const Eigenproblem coarse(level.laplacian, level.mass, nullptr);
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
  if (count == 0) {
    return none;
  }
  pairs.vectors = prolonged(level, pairs.vectors, problem.root_mass());
  level = {};
  problem.leave_kernel(pairs.vectors);

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
