// SPDX-License-Identifier: GPL-3.0-or-later
#include "row_groups.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace supple {
namespace {

// What comes later hardly matters to the order.
constexpr Eigen::Index kNumbers = 32;

struct Halving {
  Eigen::Array<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> rows;
  Eigen::Index size;

  void operator()(int* begin, int* end) const {
    const Eigen::Index count = end - begin;
    if (count <= size) {
      return;
    }
    // From the first row on, so that numbers far from zero keep their digits.
    const Eigen::ArrayXf first = rows.row(*begin);
    Eigen::ArrayXf sum = Eigen::ArrayXf::Zero(first.size()), squares = sum;
    for (const int* i = begin; i < end; ++i) {
      const auto away = rows.row(*i).transpose() - first;
      sum += away;
      squares += away.square();
    }
    Eigen::Index widest = 0;
    (squares - sum.square() / static_cast<float>(count)).maxCoeff(&widest);
    int* const middle = begin + (count / 2 + size - 1) / size * size;
    std::nth_element(begin, middle, end,
                     [&](int a, int b) { return rows(a, widest) < rows(b, widest); });
    (*this)(begin, middle);
    (*this)(middle, end);
  }
};

}  // namespace

std::vector<int> grouped_rows(const ConstTallBlock<double>& rows, Eigen::Index size) {
  std::vector<int> order(static_cast<size_t>(rows.rows()));
  std::iota(order.begin(), order.end(), 0);
  const Eigen::Index numbers = std::min(kNumbers, rows.cols());
  if (numbers == 0 || rows.rows() == 0) {
    return order;
  }
  const double largest = rows.leftCols(numbers).cwiseAbs().maxCoeff();
  Halving halve{{rows.rows(), numbers}, size};
  for (Eigen::Index j = 0; j < numbers; ++j) {
    const double weight =
        (largest > 1e-300 ? 1.0 / largest : 1.0) / std::sqrt(1.0 + static_cast<double>(j));
    halve.rows.col(j) = (weight * rows.col(j)).cast<float>();
  }
  halve(order.data(), order.data() + order.size());
  return order;
}

}  // namespace supple
