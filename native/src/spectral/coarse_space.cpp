// SPDX-License-Identifier: GPL-3.0-or-later
#include "coarse_space.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "supple/core/sparse_product.h"

namespace supple {
namespace {

constexpr int kSweeps = 8;                             // towards the harmonic functions
constexpr int kSmoothings = 2;                         // of them
constexpr double kLeastAtFirst = 0.02, kLeast = 0.01;  // weights, of a row's largest
constexpr double kDamping = 2.0 / 3.0;                 // of Jacobi steps that smooth

struct Aggregates {
  Eigen::VectorXi of_row;  // n
  Eigen::VectorXi roots;   // a row of each
};

// First every row whose neighbours are all free gathers them, then the rest joins a neighbour's. No
// aggregate crosses components.
Aggregates aggregates(const SparseRowMatrix& matrix) {
  const Eigen::Index n = matrix.rows();
  Eigen::VectorXi aggregate = Eigen::VectorXi::Constant(n, -1), roots(n);
  int next = 0;
  for (int i = 0; i < n; ++i) {
    bool free = aggregate[i] < 0;
    for (SparseRowMatrix::InnerIterator it(matrix, i); free && it; ++it) {
      free = aggregate[it.col()] < 0;
    }
    if (free) {
      for (SparseRowMatrix::InnerIterator it(matrix, i); it; ++it) {
        aggregate[it.col()] = next;
      }
      roots[next] = i;
      aggregate[i] = next++;
    }
  }
  Eigen::VectorXi joined = aggregate;
  for (int i = 0; i < n; ++i) {
    if (aggregate[i] >= 0) {
      continue;
    }
    double strongest = -1.0;
    for (SparseRowMatrix::InnerIterator it(matrix, i); it; ++it) {
      if (aggregate[it.col()] >= 0 && -it.value() > strongest) {
        strongest = -it.value();
        joined[i] = aggregate[it.col()];
      }
    }
    if (joined[i] < 0) {  // only obtuse corners around it
      for (SparseRowMatrix::InnerIterator it(matrix, i); it && joined[i] < 0; ++it) {
        joined[i] = aggregate[it.col()];
      }
    }
  }
  return {std::move(joined), roots.head(next)};
}

SparseRowMatrix one_a_row(const Eigen::VectorXi& columns, Eigen::Index count) {
  SparseRowMatrix result(columns.size(), count);
  result.reserve(Eigen::VectorXi::Ones(columns.size()));
  for (Eigen::Index i = 0; i < columns.size(); ++i) {
    result.insert(i, columns[i]) = 1.0;
  }
  result.makeCompressed();
  return result;
}

// What takes each row but the roots to the mean of its neighbours by the Laplacian's weights, those
// of obtuse corners left out, and leaves the roots.
SparseRowMatrix averages(const SparseRowMatrix& laplacian, const Eigen::VectorXi& roots) {
  SparseRowMatrix result = laplacian;
  Eigen::Array<bool, Eigen::Dynamic, 1> is_root =
      Eigen::Array<bool, Eigen::Dynamic, 1>::Constant(laplacian.rows(), false);
  is_root(roots) = true;
  for (Eigen::Index i = 0; i < result.rows(); ++i) {
    double sum = 0.0;
    for (SparseRowMatrix::InnerIterator it(result, i); it; ++it) {
      it.valueRef() = it.col() == i ? 0.0 : std::max(0.0, -it.value());
      sum += it.value();
    }
    const bool keep = is_root[i] || sum <= 0.0;
    for (SparseRowMatrix::InnerIterator it(result, i); it; ++it) {
      it.valueRef() = keep ? double(it.col() == i) : it.value() / sum;
    }
  }
  result.prune(0.0);
  return result;
}

}  // namespace

CoarseSpace coarse_space(const SparseMatrix& laplacian, const Eigen::VectorXd& mass, int rings) {
  const SparseRowMatrix rows = laplacian;
  const Aggregates parts = aggregates(rings == 2 ? sparse_product(rows, rows) : rows);
  CoarseSpace space;
  SparseRowMatrix& p = space.prolongation;
  p = one_a_row(parts.of_row, parts.roots.size());
  const SparseRowMatrix average = averages(rows, parts.roots);
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    p = thinned(sparse_product(average, p), kLeastAtFirst);
  }
  SparseRowMatrix step = rows;  // 1 - damping D^-1 W, D half the sum of a row's sizes: its
                                // diagonal, where no weight is negative
  for (Eigen::Index i = 0; i < step.rows(); ++i) {
    // Obtuse corners can leave a diagonal far below the row's other entries.
    double around = 0.0;
    for (SparseRowMatrix::InnerIterator it(rows, i); it; ++it) {
      around += std::abs(it.value());
    }
    const double diagonal = around / 2.0;
    for (SparseRowMatrix::InnerIterator it(step, i); it; ++it) {
      it.valueRef() =
          double(it.col() == i) - (diagonal > 0.0 ? kDamping / diagonal * it.value() : 0.0);
    }
  }
  for (int smoothing = 0; smoothing < kSmoothings; ++smoothing) {
    p = thinned(sparse_product(step, p), smoothing + 1 < kSmoothings ? 0.0 : kLeast);
  }
  const SparseRowMatrix transposed = p.transpose();
  space.laplacian = sparse_product(transposed, sparse_product(rows, p));
  space.mass = transposed * mass;
  // Small negative weights can outweigh the others only where a root has hardly any mass.
  const double least = 1e-6 * mass.sum() / static_cast<double>(space.mass.size());
  space.mass = space.mass.cwiseMax(least);
  return space;
}

}  // namespace supple
