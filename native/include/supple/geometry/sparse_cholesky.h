// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <string>

#include "supple/core/types.h"

namespace supple {

/// Which library orders and factors.
enum class CholeskyBackend {
  cholmod,  ///< CHOLMOD, supernodal; the default where it was built in
  eigen,    ///< Eigen's SimplicialLDLT, always there
};

/// How a fill-reducing ordering is looked for.
enum class CholeskyOrdering {
  automatic,  ///< AMD, and METIS where AMD leaves much fill; with Eigen, AMD
  amd,        ///< approximate minimum degree (Amestoy, Davis and Duff 1996)
  metis,      ///< nested dissection (Karypis and Kumar 1998); CHOLMOD alone
};
/// Errors of both: `bad_option` for any other name.
CholeskyBackend cholesky_backend(const std::string& name);
CholeskyOrdering cholesky_ordering(const std::string& name);

/// What factoring needs to know of a matrix's pattern: a fill-reducing ordering, the elimination
/// tree, the supernodes. Found once a connectivity and shared by every matrix that has its pattern.
/// Immutable.
class SymbolicCholesky {
 public:
  using Backend = CholeskyBackend;

  /// pattern: n x n, symmetric, both triangles stored, explicit zeros counted; values are not read.
  /// ordering: n, the row at each place; empty to look for one (AMD, and METIS where AMD leaves
  /// much fill), which takes longer than all the rest.
  /// Errors: `wrong_shape`; `bad_option` if the backend is not available or the ordering is no
  /// permutation.
  explicit SymbolicCholesky(const SparseMatrix& pattern, Backend backend = default_backend(),
                            const Eigen::VectorXi& ordering = {});
  /// The same with an ordering that is looked for as `method` says. Errors: also `bad_option` where
  /// the backend has no such method.
  SymbolicCholesky(const SparseMatrix& pattern, Backend backend, CholeskyOrdering method);
  ~SymbolicCholesky();

  static bool available(Backend backend);
  static Backend default_backend();

  Backend backend() const;
  Eigen::Index size() const;
  /// n: the row at each place of the factor.
  const Eigen::VectorXi& ordering() const;

 private:
  friend class SparseCholesky;
  struct Impl;
  void analyse(const SparseMatrix& pattern, Backend backend, const Eigen::VectorXi& ordering,
               CholeskyOrdering method);
  std::unique_ptr<const Impl> impl_;
};

/// For matrices from outside, of which a factorisation would read one triangle without a word.
/// Errors: `wrong_shape` if not square; `not_positive_definite` naming the first entry that differs
/// from its mirror image by more than 1e-10 of the largest of all.
void check_symmetric(const SparseMatrix& matrix);

/// Factorisation of a sparse symmetric positive definite matrix, made once and solved with often.
/// With `SymbolicCholesky`, the only place that knows which library does it. Immutable: safe to use
/// from several threads.
class SparseCholesky {
 public:
  using Backend = CholeskyBackend;
  static bool available(Backend backend) { return SymbolicCholesky::available(backend); }
  static Backend default_backend() { return SymbolicCholesky::default_backend(); }

  /// matrix: n x n, symmetric positive definite; both triangles stored.
  /// Errors: `not_positive_definite`; `wrong_shape` if not square; `bad_option` if the backend is
  /// not available.
  explicit SparseCholesky(const SparseMatrix& matrix, Backend backend = default_backend());
  /// matrix: with the pattern that `symbolic` was made from; nullptr to analyse it here. Errors:
  /// `not_positive_definite`; `wrong_shape` for another number of rows or entries.
  SparseCholesky(const SparseMatrix& matrix, std::shared_ptr<const SymbolicCholesky> symbolic);
  ~SparseCholesky();
  SparseCholesky(SparseCholesky&&) noexcept;
  SparseCholesky& operator=(SparseCholesky&&) noexcept;

  Eigen::Index size() const;
  Backend backend() const;
  /// The analysis it was made with.
  const SymbolicCholesky& symbolic() const;
  /// Entries of the factor, a measure of memory and of the time of a solve.
  Eigen::Index factor_entries() const;
  /// n x c right-hand sides to n x c solutions; columns are shared among the threads. In single
  /// precision the error is some 1e-5 of the solution, and half of the memory is read: for what is
  /// corrected again later. The factor is made in double precision and rounded when first asked
  /// for; Eigen's backend stays at double.
  RowMatrix<double> solve(const RowMatrix<double>& rhs,
                          Precision precision = Precision::full) const;
  /// The two halves of `solve`, with A = P^T L L^T P: L^-1 P rhs, in the factor's own order of rows
  /// (row i is that of `symbolic().ordering()[i]`), and P^T L^-T of such rows.
  RowMatrix<double> forward(const RowMatrix<double>& rhs,
                            Precision precision = Precision::full) const;
  RowMatrix<double> backward(const RowMatrix<double>& half,
                             Precision precision = Precision::full) const;

 private:
  struct Solve;
  struct Impl;
  std::unique_ptr<const Impl> impl_;
};

}  // namespace supple
