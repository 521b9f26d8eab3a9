// SPDX-License-Identifier: GPL-3.0-or-later
#include "eigenproblem.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

namespace supple {
namespace {

SparseMatrix shifted(const SparseMatrix& laplacian, const Eigen::VectorXd& mass, double shift) {
  SparseMatrix result = laplacian;
  result.diagonal() += shift * mass;
  return result;
}

}  // namespace

Eigenproblem::Eigenproblem(const SparseMatrix& laplacian, const Eigen::VectorXd& mass,
                           std::shared_ptr<const SymbolicCholesky> symbolic)
    : laplacian_(laplacian),
      mass_(mass),
      root_mass_(mass.cwiseSqrt()),
      // Of the order of the second eigenvalue, so that the factor stays well conditioned.
      shift_(1.0 / mass.sum()) {
  const Eigen::VectorXd inverse_root = root_mass_.cwiseInverse();
  symmetric_ = inverse_root.asDiagonal() * laplacian * inverse_root.asDiagonal();
  factor_ =
      std::make_unique<const SparseCholesky>(shifted(laplacian, mass, shift_), std::move(symbolic));
  find_components();
}

void Eigenproblem::find_components() {
  const Eigen::Index n = laplacian_.rows();
  Eigen::VectorXi label = Eigen::VectorXi::Constant(n, -1);
  std::vector<double> total;
  std::vector<int> open;
  for (int start = 0; start < n; ++start) {
    if (label[start] >= 0) {
      continue;
    }
    const int piece = static_cast<int>(total.size());
    total.push_back(0.0);
    label[start] = piece;
    open.push_back(start);
    while (!open.empty()) {
      const int i = open.back();
      open.pop_back();
      total.back() += mass_[i];
      for (SparseMatrix::InnerIterator it(laplacian_, i); it; ++it) {
        if (label[it.row()] < 0) {
          label[it.row()] = piece;
          open.push_back(static_cast<int>(it.row()));
        }
      }
    }
  }
  std::vector<int> order(total.size()), rank(total.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return total[static_cast<size_t>(a)] > total[static_cast<size_t>(b)];
  });
  component_mass_.resize(total.size());
  for (size_t r = 0; r < order.size(); ++r) {
    rank[static_cast<size_t>(order[r])] = static_cast<int>(r);
    component_mass_[r] = total[static_cast<size_t>(order[r])];
  }
  component_ = label.unaryExpr([&](int piece) { return rank[static_cast<size_t>(piece)]; });
}

RowMatrix<double> Eigenproblem::inverse(const RowMatrix<double>& block) const {
  RowMatrix<double> result = factor_->solve(root_mass_.asDiagonal() * block);
  result = root_mass_.asDiagonal() * result;
  return result;
}

RowMatrix<double> Eigenproblem::kernel(Eigen::Index limit) const {
  const Eigen::Index count = std::min(limit, kernel_size());
  RowMatrix<double> result = RowMatrix<double>::Zero(size(), count);
  for (Eigen::Index i = 0; i < size(); ++i) {
    if (component_[i] < count) {
      result(i, component_[i]) =
          root_mass_[i] / std::sqrt(component_mass_[static_cast<size_t>(component_[i])]);
    }
  }
  return result;
}

void Eigenproblem::leave_kernel(RowMatrix<double>& block) const {
  RowMatrix<double> mean = RowMatrix<double>::Zero(kernel_size(), block.cols());
  for (Eigen::Index i = 0; i < size(); ++i) {
    mean.row(component_[i]) += root_mass_[i] * block.row(i);
  }
  for (Eigen::Index c = 0; c < mean.rows(); ++c) {
    mean.row(c) /= component_mass_[static_cast<size_t>(c)];
  }
#pragma omp parallel for schedule(static)
  for (Eigen::Index i = 0; i < size(); ++i) {
    block.row(i) -= root_mass_[i] * mean.row(component_[i]);
  }
}

Eigen::VectorXd Eigenproblem::residuals(const Pairs& pairs) const {
  constexpr Eigen::Index kTogether = 16;  // columns at once: no second n x k matrix in memory
  Eigen::VectorXd result(pairs.size());
  for (Eigen::Index first = 0; first < pairs.size(); first += kTogether) {
    const Eigen::Index count = std::min(kTogether, pairs.size() - first);
    const RowMatrix<double> x = pairs.vectors.middleCols(first, count);
    Eigen::RowVectorXd sum = Eigen::RowVectorXd::Zero(count);
    const Eigen::RowVectorXd values = pairs.values.segment(first, count).transpose();
    RowMatrix<double> r(size(), count);
    // S is symmetric: its column i is its row i.
#pragma omp parallel for schedule(static)
    for (Eigen::Index i = 0; i < size(); ++i) {
      r.row(i) = -values.cwiseProduct(x.row(i));
      for (SparseMatrix::InnerIterator it(symmetric_, i); it; ++it) {
        r.row(i) += it.value() * x.row(it.row());
      }
    }
    result.segment(first, count) = r.colwise().norm().transpose().cwiseQuotient(
        pairs.values.segment(first, count).cwiseMax(1.0));
  }
  return result;
}

double Eigenproblem::rounding_floor() const {
  double largest_column = 0.0;
  for (int c = 0; c < symmetric_.outerSize(); ++c) {
    double sum = 0.0;
    for (SparseMatrix::InnerIterator it(symmetric_, c); it; ++it) {
      sum += std::abs(it.value());
    }
    largest_column = std::max(largest_column, sum);
  }
  return 16.0 * std::numeric_limits<double>::epsilon() * largest_column;
}

}  // namespace supple
