// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <string>

#include "supple/core/progress.h"
#include "supple/core/types.h"
#include "supple/geometry/sparse_cholesky.h"

namespace supple {

/// How eigenfunctions are found.
enum class EigenMethod {
  automatic,     ///< `block_krylov`
  block_krylov,  ///< shift-invert block Krylov-Schur on the Cholesky factor
  /// A coarse basis, prolonged and corrected; residual 1e-2 instead of 1e-8. For large meshes: with
  /// less than some 200 vertices a function (more where few are wanted), `block_krylov`.
  multiresolution,
  lanczos,  ///< shift-invert Lanczos by Spectra, the reference
  dense,    ///< every eigenvalue; chosen by itself on small meshes, whatever is asked
};
const char* to_string(EigenMethod method);
/// Errors: `bad_option` for any other name.
EigenMethod eigen_method(const std::string& name);

/// The first eigenfunctions of W phi = lambda M phi, smallest eigenvalues first.
struct Eigenbasis {
  RowMatrix<double> functions;  ///< n x k, M-orthonormal
  Eigen::VectorXd values;       ///< k, ascending, >= 0, in 1 / area
  Eigen::VectorXd mass;         ///< n, the diagonal of M
  /// Largest |M^-1/2 (W phi - lambda M phi)| / max(lambda, 1) over the pairs, checked on return.
  double residual = 0.0;
  EigenMethod method = EigenMethod::automatic;  ///< the one that was used

  Eigen::Index size() const { return values.size(); }
  /// k' x c coefficients Phi^T M f of an n x c field in the first `count` functions.
  RowMatrix<double> coefficients(const RowMatrix<double>& field, Eigen::Index count) const;
  /// n x c field from k' x c coefficients.
  RowMatrix<double> expand(const RowMatrix<double>& coefficients) const;
  /// Spectral projection Phi Phi^T M f with the first `count` functions. Source: the paper, Eqn 7.
  RowMatrix<double> project(const RowMatrix<double>& field, Eigen::Index count) const;
  /// The largest count <= `limit` that does not cut through a (nearly) multiple eigenvalue; the
  /// smallest above where there is none (a mesh of more pieces than `limit` has that many zeros).
  /// Elsewhere the span would depend on rounding, and a turned mesh would not give the turned
  /// result.
  Eigen::Index stable_count(Eigen::Index limit) const;
};

/// The largest count <= `limit` that cuts through no multiple eigenvalue of either basis (or 1).
Eigen::Index stable_count(const Eigenbasis& a, const Eigenbasis& b, Eigen::Index limit);

struct EigenbasisOptions {
  int count = 128;  ///< eigenfunctions wanted; min(count, n) are returned
  EigenMethod method = EigenMethod::automatic;
  /// The stated residual, not asked of `multiresolution`; where rounding alone leaves more (16 eps
  /// |M^-1/2 W M^-1/2|_1, slivers), that.
  double residual = 1e-8;
  /// The residual that `multiresolution` is asked.
  double coarse_residual = 1e-2;
  int max_restarts = 50;
};

/// laplacian: n x n cotangent Laplacian; mass: n, positive; symbolic: of the Laplacian's pattern,
/// or nullptr. Multiple eigenvalues (several components, symmetric shapes) are found whole: the
/// constants of the components are known, and where as many copies turn up as a block holds, the
/// complement is searched for more. Errors: `no_convergence` with the residual reached;
/// `cancelled`.
Eigenbasis eigenbasis(const SparseMatrix& laplacian, const Eigen::VectorXd& mass,
                      const EigenbasisOptions& options, ProgressRange progress = {},
                      std::shared_ptr<const SymbolicCholesky> symbolic = nullptr);

}  // namespace supple
