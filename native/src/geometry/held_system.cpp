// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/held_system.h"

#include <string>
#include <vector>

#include "supple/core/error.h"

namespace supple {
namespace {

// Position of each row among the held, or -1.
Eigen::VectorXi held_slots(Eigen::Index n, const Eigen::VectorXi& held) {
  Eigen::VectorXi slot = Eigen::VectorXi::Constant(n, -1);
  for (Eigen::Index i = 0; i < held.size(); ++i) {
    if (held[i] < 0 || held[i] >= n) {
      throw Error(ErrorCode::index_out_of_range, "Held row " + std::to_string(held[i]) +
                                                     " is not in a system of " + std::to_string(n) +
                                                     " rows.");
    }
    if (slot[held[i]] >= 0) {
      throw Error(ErrorCode::overlapping_handles,
                  "Held row " + std::to_string(held[i]) + " is listed twice.");
    }
    slot[held[i]] = static_cast<int>(i);
  }
  return slot;
}

// n x held: the columns of the held rows, without the held rows themselves.
SparseMatrix coupling_of(const SparseMatrix& matrix, const Eigen::VectorXi& held) {
  const Eigen::VectorXi slot = held_slots(matrix.rows(), held);
  std::vector<Eigen::Triplet<double>> entries;
  for (int h = 0; h < held.size(); ++h) {
    for (SparseMatrix::InnerIterator it(matrix, held[h]); it; ++it) {
      if (slot[it.row()] < 0) {
        entries.emplace_back(static_cast<int>(it.row()), h, it.value());
      }
    }
  }
  SparseMatrix result(matrix.rows(), held.size());
  result.setFromTriplets(entries.begin(), entries.end());
  return result;
}

// The matrix with the held rows and columns set to those of a diagonal one. Its pattern stays, so
// that one analysis serves every set of held rows.
SparseMatrix with_held_rows(const SparseMatrix& matrix, const Eigen::VectorXi& held) {
  const Eigen::VectorXi slot = held_slots(matrix.rows(), held);
  SparseMatrix result = matrix;
  for (int c = 0; c < result.outerSize(); ++c) {
    for (SparseMatrix::InnerIterator it(result, c); it; ++it) {
      if (slot[it.row()] >= 0 || slot[c] >= 0) {
        it.valueRef() = it.row() != c ? 0.0 : it.value() > 0.0 ? it.value() : 1.0;
      }
    }
  }
  return result;
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
                       std::shared_ptr<const SymbolicCholesky> symbolic)
    : held_(held),
      coupling_(coupling_of(matrix, held)),
      factor_(with_held_rows(matrix, held), std::move(symbolic)) {}

Points HeldSystem::solve(const Points& rhs, const Points& held_values) const {
  RowMatrix<double> reduced = rhs;
  reduced.noalias() -= coupling_ * held_values;
  for (const int row : held_) {
    reduced.row(row).setZero();
  }
  Points result = factor_.solve(reduced);
  for (Eigen::Index i = 0; i < held_.size(); ++i) {
    result.row(held_[i]) = held_values.row(i);
  }
  return result;
}

Points HeldSystem::solve_backward(const Points& grad) const {
  RowMatrix<double> reduced = grad;
  for (const int row : held_) {
    reduced.row(row).setZero();
  }
  Points result = factor_.solve(reduced);
  for (const int row : held_) {
    result.row(row).setZero();
  }
  return result;
}

FreePoisson::FreePoisson(const SparseMatrix& laplacian, const Eigen::VectorXd& mass,
                         const Eigen::VectorXi& component, int component_count,
                         std::shared_ptr<const SymbolicCholesky> symbolic)
    : mass_(mass),
      component_(component),
      component_mass_(Eigen::VectorXd::Zero(component_count)),
      pinned_(laplacian, first_of_each(component, component_count), std::move(symbolic)) {
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
