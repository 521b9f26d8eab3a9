// SPDX-License-Identifier: GPL-3.0-or-later
// What stands behind `SparseCholesky`, one implementation a library.
#pragma once

#include <memory>

#include "supple/core/types.h"
#include "supple/geometry/sparse_cholesky.h"

namespace supple {

/// Which part of a solve: all of it, or one half.
enum class Substitution { both, forward, backward };

/// A numeric factorisation, n x n, n > 0.
class Factor {
 public:
  virtual ~Factor() = default;
  virtual Eigen::Index entries() const = 0;
  /// n x c to n x c, c > 0; safe to call from several threads.
  virtual RowMatrix<double> solve(const RowMatrix<double>& rhs, Substitution part,
                                  Precision precision) const = 0;
};

/// The error of every factorisation that fails.
[[noreturn]] void throw_not_definite(Eigen::Index n);

#ifdef SUPPLE_WITH_CHOLMOD
/// CHOLMOD's analysis of a pattern; makes its factors.
class CholmodSymbolic {
 public:
  /// method: how to look for an ordering where `ordering` is empty.
  CholmodSymbolic(const SparseMatrix& pattern, const Eigen::VectorXi& ordering,
                  CholeskyOrdering method);
  ~CholmodSymbolic();
  Eigen::VectorXi ordering() const;
  std::unique_ptr<const Factor> factor(const SparseMatrix& matrix) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};
#endif

}  // namespace supple
