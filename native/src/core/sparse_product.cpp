// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/core/sparse_product.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "supple/core/parallel.h"

namespace supple {
namespace {

// The rows of one stretch, one after the other.
struct Rows {
  std::vector<int> columns;
  std::vector<double> values;
  std::vector<int> ends;  // of each row, in the two above
};

constexpr Eigen::Index kTogether = 4096;  // rows of a stretch

// A matrix of `count` rows; fill(rows, first, last) appends those of a stretch.
template <class Fill>
SparseRowMatrix by_rows(Eigen::Index count, Eigen::Index columns, const Fill& fill) {
  std::vector<Rows> parts(static_cast<size_t>((count + kTogether - 1) / kTogether));
  run_at_once(parts.size(), [&](size_t p) {
    const Eigen::Index first = static_cast<Eigen::Index>(p) * kTogether;
    fill(parts[p], first, std::min(first + kTogether, count));
  });
  SparseRowMatrix result(count, columns);
  std::vector<size_t> begin(parts.size() + 1, 0);
  for (size_t p = 0; p < parts.size(); ++p) {
    begin[p + 1] = begin[p] + parts[p].values.size();
  }
  result.resizeNonZeros(static_cast<Eigen::Index>(begin.back()));
  run_at_once(parts.size(), [&](size_t p) {
    const auto at = static_cast<std::ptrdiff_t>(begin[p]);
    std::copy(parts[p].columns.begin(), parts[p].columns.end(), result.innerIndexPtr() + at);
    std::copy(parts[p].values.begin(), parts[p].values.end(), result.valuePtr() + at);
    int* const ends = result.outerIndexPtr() + p * size_t{kTogether} + 1;
    for (size_t i = 0; i < parts[p].ends.size(); ++i) {
      ends[i] = static_cast<int>(begin[p]) + parts[p].ends[i];
    }
  });
  return result;
}

}  // namespace

SparseRowMatrix sparse_product(const SparseRowMatrix& a, const SparseRowMatrix& b) {
  return by_rows(a.rows(), b.cols(), [&](Rows& rows, Eigen::Index first, Eigen::Index last) {
    std::vector<std::pair<int, double>> terms;
    for (Eigen::Index i = first; i < last; ++i) {
      terms.clear();
      for (SparseRowMatrix::InnerIterator of_a(a, i); of_a; ++of_a) {
        for (SparseRowMatrix::InnerIterator of_b(b, of_a.col()); of_b; ++of_b) {
          terms.emplace_back(static_cast<int>(of_b.col()), of_a.value() * of_b.value());
        }
      }
      std::stable_sort(terms.begin(), terms.end(),
                       [](const auto& x, const auto& y) { return x.first < y.first; });
      const size_t begin = rows.columns.size();
      for (const auto& [column, value] : terms) {
        if (rows.columns.size() > begin && rows.columns.back() == column) {
          rows.values.back() += value;
        } else {
          rows.columns.push_back(column);
          rows.values.push_back(value);
        }
      }
      rows.ends.push_back(static_cast<int>(rows.columns.size()));
    }
  });
}

SparseRowMatrix thinned(const SparseRowMatrix& matrix, double least) {
  return by_rows(matrix.rows(), matrix.cols(),
                 [&](Rows& rows, Eigen::Index first, Eigen::Index last) {
                   for (Eigen::Index i = first; i < last; ++i) {
                     double largest = 0.0, sum = 0.0;
                     for (SparseRowMatrix::InnerIterator it(matrix, i); it; ++it) {
                       largest = std::max(largest, std::abs(it.value()));
                     }
                     const size_t begin = rows.values.size();
                     for (SparseRowMatrix::InnerIterator it(matrix, i); it; ++it) {
                       if (std::abs(it.value()) >= least * largest) {
                         rows.columns.push_back(static_cast<int>(it.col()));
                         rows.values.push_back(it.value());
                         sum += it.value();
                       }
                     }
                     for (size_t k = begin; k < rows.values.size() && sum != 0.0; ++k) {
                       rows.values[k] /= sum;
                     }
                     rows.ends.push_back(static_cast<int>(rows.columns.size()));
                   }
                 });
}

}  // namespace supple
