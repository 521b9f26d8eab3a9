// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <string>

#include "supple/core/types.h"
#include "supple/geometry/sparse_cholesky.h"
#include "supple/geometry/surface_operators.h"

namespace supple {

/// Which system recovers an embedding; see `EmbeddingRecovery`.
enum class RecoveryForm { product, literal };
const char* to_string(RecoveryForm form);
/// Errors: `bad_option` for any other name.
RecoveryForm recovery_form(const std::string& name);

struct RecoveryOptions {
  RecoveryForm form = RecoveryForm::product;
  /// `product`: pull s of the points, > 0, in 1 / area; what is larger than sqrt(area / s) follows
  /// the points, what is smaller the Jacobians.
  double pull = 4000.0;
  /// `literal`: the paper's alpha_4 (> 0) and alpha_5 (>= 0).
  double point_weight = 2e4;
  double jacobian_weight = 1.5e5;
};

/// The embedding V near given points P whose Jacobians are near given ones J. n vertices, m faces;
/// W Laplacian, M mass scaled to the sum 1, d = G^T A J. Units are the caller's: P and V are in the
/// units of the vertices that W, M and d come from. Factored once; immutable.
///
/// `product` (b > 0 is a factor of both sides and leaves V as it is, so it is not needed):
///
///     b (W + s M) M^-1 (W + s M) V = b s^2 M P + (2 b s + b W M^-1) d
///
/// the minimum of s^2 |V - P|^2_M + 2 s |G V - J|^2_A + |M^-1 (W V - d)|^2_M, computed as two
/// screened Poisson equations one after the other, with a factor of the Laplacian's own pattern:
///
///     (W + s M) U = s M P + d,    (W + s M) V = s M U + d
///
/// Where J are the Jacobians of a map, W of the map is d; if P is the map too, U and V are it
/// exactly.
///
/// `literal`, the paper's last system (the one after "embedding recovery ... is solved via") as
/// printed, with its Delta read as the cotangent matrix W, not as M^-1 W:
///
///     (W + a4 M + a5 W^T M W) V = a4 M P + a5 W^T M d
///
/// a matrix of two rings. Its smoothness term W V has nothing on the right: of J and P of one map,
/// V is that map smoothed, V - map = -(W + a4 M + a5 W M W)^-1 W map; it is the map exactly for
/// P = map + M^-1 W map / a4.
///
/// In both, moving P by t moves V by t, whatever the number of components.
/// Source: the paper, embedding recovery (minimisation and linear system after it).
class EmbeddingRecovery {
 public:
  /// laplacian: n x n; mass: n, positive; divergence: n x 3m, grad^T A; all of one mesh, in any
  /// units. symbolic: of the pattern of `system`, for `product` that of the Laplacian; nullptr to
  /// analyse it here.
  /// Errors: `wrong_shape`, also for another pattern's analysis; `bad_option`;
  /// `not_positive_definite`.
  EmbeddingRecovery(const SparseMatrix& laplacian, const Eigen::VectorXd& mass,
                    SparseMatrix divergence, const RecoveryOptions& options = {},
                    std::shared_ptr<const SymbolicCholesky> symbolic = nullptr);
  explicit EmbeddingRecovery(const SurfaceOperators& operators, const RecoveryOptions& options = {},
                             std::shared_ptr<const SymbolicCholesky> symbolic = nullptr);

  /// The matrix that is factored: W + s M, or the left side of the literal form. Errors: those of
  /// the constructor.
  static SparseMatrix system(const SparseMatrix& laplacian, const Eigen::VectorXd& mass,
                             const RecoveryOptions& options);

  const RecoveryOptions& options() const { return options_; }
  /// Entries of the factor.
  Eigen::Index factor_entries() const { return factor_.factor_entries(); }
  /// coarse: n x 3 points P; jacobians: m x 9. Returns n x 3. Errors: `wrong_shape`.
  Points solve(const Points& coarse, const MatrixField& jacobians) const;

 private:
  RecoveryOptions options_;
  Eigen::VectorXd mass_;  // sum 1
  SparseMatrix divergence_;
  SparseMatrix laplacian_;  // for the right side of the literal form, else empty
  SparseCholesky factor_;
};

}  // namespace supple
