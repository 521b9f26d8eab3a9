// SPDX-License-Identifier: GPL-3.0-or-later
#include "copies.h"

#include <algorithm>

namespace supple {
namespace {

// The most values within `same` of the first of them.
Eigen::Index most_copies(const Eigen::VectorXd& values, double same) {
  Eigen::Index most = 0, first = 0;
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    if (values[i] - values[first] > same * std::max(values[i], 1.0)) {
      first = i;
    }
    most = std::max(most, i - first + 1);
  }
  return most;
}

}  // namespace

Pairs merged(const Pairs& a, const Pairs& b, Eigen::Index count) {
  Pairs result;
  count = std::min(count, a.size() + b.size());
  result.values.resize(count);
  result.vectors.resize(a.vectors.rows(), count);
  for (Eigen::Index i = 0, j = 0; i + j < count;) {
    const Eigen::Index to = i + j;
    if (j == b.size() || (i < a.size() && a.values[i] <= b.values[j])) {
      result.values[to] = a.values[i];
      result.vectors.col(to) = a.vectors.col(i++);
    } else {
      result.values[to] = b.values[j];
      result.vectors.col(to) = b.vectors.col(j++);
    }
  }
  return result;
}

Pairs with_all_copies(const Eigenproblem& problem, Eigen::Index count, Eigen::Index together,
                      double same, const PairSearch& search) {
  Pairs found = search(RowMatrix<double>(problem.size(), 0), count, 1);
  for (uint64_t seed = 2; found.size() < count || most_copies(found.values, same) >= together;
       ++seed) {
    const Eigen::Index left = problem.size() - problem.kernel_size() - found.size();
    if (left < 4 || seed > 40) {
      break;
    }
    const Pairs more = search(found.vectors, std::min<Eigen::Index>(left / 4, 4), seed);
    if (more.size() == 0 ||
        (found.size() == count && more.values[0] >= found.values[count - 1] * (1.0 - same))) {
      break;
    }
    found = merged(found, more, count);
  }
  return found;
}

}  // namespace supple
