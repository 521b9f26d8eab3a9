// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/held_system.h"

#include <Eigen/LU>
#include <string>
#include <vector>

#include "held_rows.h"
#include "supple/core/error.h"

namespace supple {

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

namespace {

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

}  // namespace

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

// What is factored, and the rows that were held then.
struct HeldSystem::Factored {
  Factored(const SparseMatrix& matrix, const Eigen::VectorXi& held_in,
           std::shared_ptr<const SymbolicCholesky> symbolic)
      : held(held_in),
        slot(held_slots(matrix.rows(), held_in)),
        coupling(coupling_of(matrix, held_in)),
        factor(with_held_rows(matrix, held_in), std::move(symbolic)) {
    std::vector<Eigen::Triplet<double>> entries;
    for (int h = 0; h < held.size(); ++h) {
      for (SparseMatrix::InnerIterator it(matrix, held[h]); it; ++it) {
        if (slot[it.row()] >= 0) {
          entries.emplace_back(slot[it.row()], h, it.value());
        }
      }
    }
    among.resize(held.size(), held.size());
    among.setFromTriplets(entries.begin(), entries.end());
  }

  Eigen::VectorXi held, slot;
  SparseMatrix coupling;  // n x held, of the other rows
  SparseMatrix among;     // held x held
  SparseCholesky factor;
};

struct HeldSystem::Changes {
  Eigen::VectorXi source;  // per place in factored.held: its place in held_, or -1: free now
  std::vector<int> added;  // places in held_ that were not factored as held
  std::vector<int> freed;  // places in factored.held
  // Columns in the factor's order: L^-1 of the unit vectors of `added`, then of the coupling of
  // `freed` with its sign turned, so that the half of a solution is half + columns [m; x].
  SparseMatrix columns;
  Eigen::PartialPivLU<Eigen::MatrixXd> small;
};

HeldSystem::HeldSystem(const SparseMatrix& matrix, const Eigen::VectorXi& held,
                       std::shared_ptr<const SymbolicCholesky> symbolic)
    : factored_(std::make_shared<const Factored>(matrix, held, std::move(symbolic))), held_(held) {}

std::optional<HeldSystem> HeldSystem::changed(const Eigen::VectorXi& held) const {
  const Factored& base = *factored_;
  const Eigen::Index n = base.slot.size();
  const Eigen::VectorXi slot = held_slots(n, held);
  auto changes = std::make_shared<Changes>();
  changes->source.resize(base.held.size());
  for (int i = 0; i < base.held.size(); ++i) {
    changes->source[i] = slot[base.held[i]];
    if (changes->source[i] < 0) {
      changes->freed.push_back(i);
    }
  }
  for (int i = 0; i < held.size(); ++i) {
    if (base.slot[held[i]] < 0) {
      changes->added.push_back(i);
    }
  }
  const auto added = static_cast<Eigen::Index>(changes->added.size());
  const auto freed = static_cast<Eigen::Index>(changes->freed.size());
  if (added + freed > kMostChanges) {
    return std::nullopt;
  }
  RowMatrix<double> columns = RowMatrix<double>::Zero(n, added + freed);
  for (Eigen::Index i = 0; i < added; ++i) {
    columns(held[changes->added[static_cast<size_t>(i)]], i) = 1.0;
  }
  for (Eigen::Index i = 0; i < freed; ++i) {
    for (SparseMatrix::InnerIterator it(base.coupling, changes->freed[static_cast<size_t>(i)]); it;
         ++it) {
      columns(it.row(), added + i) = -it.value();
    }
  }
  columns = base.factor.forward(columns);
  changes->columns = columns.sparseView(0.0, 0.0);
  // With Y, Z the two kinds of columns (Z with its sign), m the multipliers, x the freed rows:
  //   Y^T Y m + Y^T Z x = held values - Y^T half
  //   -Z^T Y m + (A_xx - Z^T Z) x = rhs - A_xk held values + Z^T half
  const SparseMatrix gram = changes->columns.transpose() * changes->columns;
  Eigen::MatrixXd small = gram;
  small.bottomRows(freed) *= -1.0;
  for (Eigen::Index i = 0; i < freed; ++i) {
    for (Eigen::Index j = 0; j < freed; ++j) {
      small(added + i, added + j) += base.among.coeff(changes->freed[static_cast<size_t>(i)],
                                                      changes->freed[static_cast<size_t>(j)]);
    }
  }
  changes->small.compute(small);
  if (added + freed > 0 && !(changes->small.rcond() > 1e-14)) {
    return std::nullopt;
  }
  HeldSystem result;
  result.factored_ = factored_;
  result.held_ = held;
  if (added + freed > 0 || !(base.held == held)) {
    result.changes_ = std::move(changes);
  }
  return result;
}

RowMatrix<double> HeldSystem::solve(RowMatrix<double> rhs, const RowMatrix<double>* held_values,
                                    Precision precision) const {
  const Factored& base = *factored_;
  const auto hold = [&](RowMatrix<double>& result) {
    for (Eigen::Index i = 0; i < held_.size(); ++i) {
      if (held_values != nullptr) {
        result.row(held_[i]) = held_values->row(i);
      } else {
        result.row(held_[i]).setZero();
      }
    }
  };
  RowMatrix<double> kept = RowMatrix<double>::Zero(base.held.size(), rhs.cols());
  const RowMatrix<double> of_held = rhs(base.held, Eigen::all);
  if (held_values != nullptr) {
    for (Eigen::Index i = 0; i < kept.rows(); ++i) {
      const Eigen::Index from = changes_ == nullptr ? i : changes_->source[i];
      if (from >= 0) {
        kept.row(i) = held_values->row(from);
      }
    }
    rhs.noalias() -= base.coupling * kept;
  }
  for (const int row : base.held) {
    rhs.row(row).setZero();
  }
  if (changes_ == nullptr) {
    RowMatrix<double> result = base.factor.solve(rhs, precision);
    hold(result);
    return result;
  }
  const Changes& changes = *changes_;
  const auto added = static_cast<Eigen::Index>(changes.added.size());
  const auto freed = static_cast<Eigen::Index>(changes.freed.size());
  RowMatrix<double> half = base.factor.forward(rhs, precision);
  RowMatrix<double> unknown = -(changes.columns.transpose() * half);
  const RowMatrix<double> between = base.among * kept;
  for (Eigen::Index i = 0; i < added && held_values != nullptr; ++i) {
    unknown.row(i) += held_values->row(changes.added[static_cast<size_t>(i)]);
  }
  for (Eigen::Index i = 0; i < freed; ++i) {
    const int place = changes.freed[static_cast<size_t>(i)];
    unknown.row(added + i) = of_held.row(place) - between.row(place) - unknown.row(added + i);
  }
  if (added + freed > 0) {
    unknown = changes.small.solve(unknown).eval();
  }
  half += changes.columns * unknown;
  RowMatrix<double> result = base.factor.backward(half, precision);
  for (Eigen::Index i = 0; i < freed; ++i) {
    result.row(base.held[changes.freed[static_cast<size_t>(i)]]) = unknown.row(added + i);
  }
  hold(result);
  return result;
}

Points HeldSystem::solve(const Points& rhs, const Points& held_values) const {
  const RowMatrix<double> values = held_values;
  return solve(rhs, &values, Precision::full);
}

Points HeldSystem::correction(const Points& residual) const {
  return solve(residual, nullptr, Precision::single);
}

std::pair<Points, Points> HeldSystem::corrections(const Points& one, const Points& two) const {
  RowMatrix<double> both(one.rows(), 6);
  both << one, two;
  both = solve(std::move(both), nullptr, Precision::single);
  return {both.leftCols(3), both.rightCols(3)};
}

Points HeldSystem::solve_backward(const Points& grad) const {
  // Its own transpose, where the held rows are 0.
  return solve(grad, nullptr, Precision::full);
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
