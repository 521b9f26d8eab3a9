// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "supple/core/types.h"

namespace supple {

/// Factorisation of a sparse symmetric positive definite matrix, made once and solved with often.
/// The only place that knows which library does it.
class SparseCholesky {
 public:
  enum class Backend {
    cholmod,  ///< CHOLMOD, supernodal where that pays; the default where it was built in
    eigen,    ///< Eigen's SimplicialLDLT, always there
  };
  static bool available(Backend backend);
  static Backend default_backend();

  /// matrix: n x n, symmetric positive definite; both triangles stored.
  /// Errors: `not_positive_definite`; `wrong_shape` if not square; `bad_option` if the backend is
  /// not available.
  explicit SparseCholesky(const SparseMatrix& matrix, Backend backend = default_backend());
  ~SparseCholesky();
  SparseCholesky(SparseCholesky&&) noexcept;
  SparseCholesky& operator=(SparseCholesky&&) noexcept;

  Eigen::Index size() const;
  Backend backend() const;
  /// n x c right-hand sides to n x c solutions. Safe to call from several threads.
  Eigen::MatrixXd solve(const Eigen::MatrixXd& rhs) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace supple
