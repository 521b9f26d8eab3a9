// SPDX-License-Identifier: GPL-3.0-or-later
// Soft maps between two surfaces from features at their vertices, with derivatives.
#pragma once

#include "supple/core/progress.h"
#include "supple/core/types.h"

namespace supple {

/// P = softmax of F1 F2^T / temperature along each row, n1 x n2, F1 and F2 features of which every
/// row is divided by its length: for each source vertex, weights of all target vertices, sum 1.
/// P is never stored. Whatever needs it computes some rows at a time and forgets them: each call
/// takes at most two blocks of `block_rows` x n2 numbers (2^20 of them or one row, 8 MB) besides
/// what it is given and returns. The same bytes for the same number of threads.
/// Source: the paper, Eqn 12; rows of length 1 as in Cao et al. 2023 (ULRSSM).
class SoftMap {
 public:
  /// source: F1, n1 x c; target: F2, n2 x c; temperature > 0.
  /// Errors: `wrong_shape`; `not_finite`, also for a row of zeros; `bad_option`.
  SoftMap(const RowMatrix<double>& source, const RowMatrix<double>& target,
          double temperature = 0.07);

  /// P X, n1 x k, of X (n2 x k). Errors: `wrong_shape`; `cancelled`.
  RowMatrix<double> apply(const RowMatrix<double>& values, ProgressRange progress = {}) const;
  /// P^T G, n2 x k: the gradient with respect to X from that with respect to P X (n1 x k).
  /// Errors: `wrong_shape`; `cancelled`.
  RowMatrix<double> apply_backward(const RowMatrix<double>& grad,
                                   ProgressRange progress = {}) const;

  /// Gradients with respect to the features as they were given, before the division.
  struct Gradient {
    RowMatrix<double> source;  ///< n1 x c
    RowMatrix<double> target;  ///< n2 x c
  };
  /// From the gradient with respect to P X (n1 x k). Errors: `wrong_shape`; `cancelled`.
  Gradient backward(const RowMatrix<double>& values, const RowMatrix<double>& grad,
                    ProgressRange progress = {}) const;

  /// n1: the target vertex of the largest weight. Ties to the lowest index.
  /// Errors: those of `nearest_rows`.
  Eigen::VectorXi hard_map(ProgressRange progress = {}) const;

  Eigen::Index rows() const { return source_.rows(); }
  Eigen::Index cols() const { return target_.rows(); }
  Eigen::Index block_rows() const { return block_rows_; }

 private:
  RowMatrix<double> rows_of_map(const RowMatrix<double>& source) const;
  template <class Step>
  void over_blocks(const ProgressRange& progress, const Step& step) const;

  RowMatrix<double> source_, target_;              // rows of length 1
  Eigen::VectorXd source_length_, target_length_;  // what they were divided by
  double temperature_;
  Eigen::Index block_rows_;
};

}  // namespace supple
