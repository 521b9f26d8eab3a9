// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <optional>
#include <utility>

#include "supple/core/types.h"
#include "supple/geometry/sparse_cholesky.h"

namespace supple {

/// A symmetric positive semidefinite system A X = B in which some rows of X are given ("held").
/// The Poisson solves of this library are all of this form. Factored once for a set of held rows; a
/// solve is two back-substitutions. Held rows stay in the matrix as rows of a diagonal one, so that
/// one symbolic analysis serves every set of them.
class HeldSystem {
 public:
  /// matrix: n x n, definite once the held rows are taken out. held: distinct indices in [0, n).
  /// symbolic: of the matrix's pattern; nullptr to analyse it here.
  /// Errors: `index_out_of_range`, `overlapping_handles` (a row held twice),
  /// `not_positive_definite`; `wrong_shape` for another pattern's analysis.
  HeldSystem(const SparseMatrix& matrix, const Eigen::VectorXi& held,
             std::shared_ptr<const SymbolicCholesky> symbolic = nullptr);
  /// Most rows that `changed` takes; with more, a new factor costs less.
  static constexpr Eigen::Index kMostChanges = 96;
  /// The same system with other rows held, on the same factor: rows that are held now are
  /// multipliers, rows that no longer are become unknowns beside it, and both together a small
  /// dense system (a Schur complement). Nothing where more than kMostChanges rows differ from those
  /// that were factored, or where that system is singular to rounding: a factor of its own then
  /// says whether the whole is definite. Errors: `index_out_of_range`, `overlapping_handles`.
  std::optional<HeldSystem> changed(const Eigen::VectorXi& held) const;

  const Eigen::VectorXi& held() const { return held_; }
  /// rhs: n x 3 (held rows ignored). held_values: one row for each held index, in `held` order.
  /// Returns n x 3 with the held rows exactly as given.
  Points solve(const Points& rhs, const Points& held_values) const;
  /// What is to be added to an X whose held rows are right where A X is wrong by -residual (n x 3,
  /// held rows ignored): the solution with held rows 0, in single precision. The error is some 1e-5
  /// of what is added, whatever X is, so a solve that is taken up again and again, as rounds of an
  /// edit do, loses nothing and reads half of the memory.
  Points correction(const Points& residual) const;
  /// The same of two residuals, in half as much time again as of one: the factor is read once.
  std::pair<Points, Points> corrections(const Points& one, const Points& two) const;
  /// Gradient with respect to `rhs` (n x 3, held rows 0) from the gradient with respect to `solve`.
  Points solve_backward(const Points& grad) const;

 private:
  struct Factored;
  struct Changes;
  HeldSystem() = default;
  /// n x c. held_values: c columns, nullptr for 0.
  RowMatrix<double> solve(RowMatrix<double> rhs, const RowMatrix<double>* held_values,
                          Precision precision) const;

  std::shared_ptr<const Factored> factored_;
  std::shared_ptr<const Changes> changes_;  // nullptr: none
  Eigen::VectorXi held_;
};

/// Poisson equation of a mesh without held vertices, W V = rhs, each component placed so that its
/// mass-weighted centroid is 0. Source: the paper, Eqn 3.
class FreePoisson {
 public:
  /// laplacian: n x n; mass: n; component: n labels in [0, component_count); symbolic: of the
  /// Laplacian's pattern; nullptr to analyse it here.
  FreePoisson(const SparseMatrix& laplacian, const Eigen::VectorXd& mass,
              const Eigen::VectorXi& component, int component_count,
              std::shared_ptr<const SymbolicCholesky> symbolic = nullptr);

  /// n x 3 to n x 3.
  Points solve(const Points& rhs) const;
  /// Gradient with respect to `rhs` from the gradient with respect to `solve`.
  Points solve_backward(const Points& grad) const;
  /// points minus each component's mass-weighted centroid.
  Points centred(const Points& points) const;

 private:
  Points centred_backward(const Points& grad) const;

  Eigen::VectorXd mass_;
  Eigen::VectorXi component_;
  Eigen::VectorXd component_mass_;
  HeldSystem pinned_;  // one vertex a component held at 0; centring takes the choice back out
};

}  // namespace supple
