// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/held_system.h"

#include <string>
#include <vector>

#include "supple/core/error.h"

namespace supple {
namespace {

// Position of each index among the free ones, or -1 - (position among the held).
Eigen::VectorXi slots(Eigen::Index n, const Eigen::VectorXi& held) {
  Eigen::VectorXi slot = Eigen::VectorXi::Zero(n);
  for (Eigen::Index i = 0; i < held.size(); ++i) {
    if (held[i] < 0 || held[i] >= n) {
      throw Error(ErrorCode::index_out_of_range, "Held row " + std::to_string(held[i]) +
                                                     " is not in a system of " + std::to_string(n) +
                                                     " rows.");
    }
    if (slot[held[i]] < 0) {
      throw Error(ErrorCode::overlapping_handles,
                  "Held row " + std::to_string(held[i]) + " is listed twice.");
    }
    slot[held[i]] = -1 - static_cast<int>(i);
  }
  int next = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    if (slot[i] == 0) {
      slot[i] = next++;
    }
  }
  return slot;
}

SparseMatrix block(const SparseMatrix& matrix, const Eigen::VectorXi& slot, Eigen::Index rows,
                   Eigen::Index cols, bool held_columns) {
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(static_cast<size_t>(matrix.nonZeros()));
  for (int c = 0; c < matrix.outerSize(); ++c) {
    if ((slot[c] < 0) != held_columns) {
      continue;
    }
    const int column = held_columns ? -1 - slot[c] : slot[c];
    for (SparseMatrix::InnerIterator it(matrix, c); it; ++it) {
      if (slot[it.row()] >= 0) {
        entries.emplace_back(slot[it.row()], column, it.value());
      }
    }
  }
  SparseMatrix result(rows, cols);
  result.setFromTriplets(entries.begin(), entries.end());
  return result;
}

Eigen::VectorXi free_indices(Eigen::Index n, const Eigen::VectorXi& slot, Eigen::Index held) {
  Eigen::VectorXi indices(n - held);
  for (int i = 0; i < n; ++i) {
    if (slot[i] >= 0) {
      indices[slot[i]] = i;
    }
  }
  return indices;
}

Eigen::VectorXi first_of_each(const Eigen::VectorXi& component, int count) {
  Eigen::VectorXi first = Eigen::VectorXi::Constant(count, -1);
  for (int i = 0; i < component.size(); ++i) {
    if (first[component[i]] < 0) {
      first[component[i]] = i;
    }
  }
  return first;
}

}  // namespace

HeldSystem::HeldSystem(const SparseMatrix& matrix, const Eigen::VectorXi& held,
                       SparseCholesky::Backend backend)
    : held_(held),
      free_(free_indices(matrix.rows(), slots(matrix.rows(), held), held.size())),
      coupling_(block(matrix, slots(matrix.rows(), held), free_.size(), held.size(), true)),
      factor_(block(matrix, slots(matrix.rows(), held), free_.size(), free_.size(), false),
              backend) {}

Points HeldSystem::solve(const Points& rhs, const Points& held_values) const {
  Eigen::MatrixXd reduced(free_.size(), 3);
  for (Eigen::Index i = 0; i < free_.size(); ++i) {
    reduced.row(i) = rhs.row(free_[i]);
  }
  reduced.noalias() -= coupling_ * held_values;
  const Eigen::MatrixXd solution = factor_.solve(reduced);
  Points result(rhs.rows(), 3);
  for (Eigen::Index i = 0; i < free_.size(); ++i) {
    result.row(free_[i]) = solution.row(i);
  }
  for (Eigen::Index i = 0; i < held_.size(); ++i) {
    result.row(held_[i]) = held_values.row(i);
  }
  return result;
}

Points HeldSystem::solve_backward(const Points& grad) const {
  Eigen::MatrixXd reduced(free_.size(), 3);
  for (Eigen::Index i = 0; i < free_.size(); ++i) {
    reduced.row(i) = grad.row(free_[i]);
  }
  const Eigen::MatrixXd solution = factor_.solve(reduced);
  Points result = Points::Zero(grad.rows(), 3);
  for (Eigen::Index i = 0; i < free_.size(); ++i) {
    result.row(free_[i]) = solution.row(i);
  }
  return result;
}

FreePoisson::FreePoisson(const SparseMatrix& laplacian, const Eigen::VectorXd& mass,
                         const Eigen::VectorXi& component, int component_count)
    : mass_(mass),
      component_(component),
      component_mass_(Eigen::VectorXd::Zero(component_count)),
      pinned_(laplacian, first_of_each(component, component_count)) {
  for (Eigen::Index i = 0; i < component_.size(); ++i) {
    component_mass_[component_[i]] += mass_[i];
  }
}

Points FreePoisson::centred(const Points& points) const {
  Points mean = Points::Zero(component_mass_.size(), 3);
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    mean.row(component_[i]) += points.row(i) * (mass_[i] / component_mass_[component_[i]]);
  }
  Points result = points;
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    result.row(i) -= mean.row(component_[i]);
  }
  return result;
}

Points FreePoisson::centred_backward(const Points& grad) const {
  Points sum = Points::Zero(component_mass_.size(), 3);
  for (Eigen::Index i = 0; i < grad.rows(); ++i) {
    sum.row(component_[i]) += grad.row(i);
  }
  Points result = grad;
  for (Eigen::Index i = 0; i < grad.rows(); ++i) {
    result.row(i) -= sum.row(component_[i]) * (mass_[i] / component_mass_[component_[i]]);
  }
  return result;
}

Points FreePoisson::solve(const Points& rhs) const {
  return centred(pinned_.solve(rhs, Points::Zero(pinned_.held().size(), 3)));
}

Points FreePoisson::solve_backward(const Points& grad) const {
  return pinned_.solve_backward(centred_backward(grad));
}

}  // namespace supple
