// SPDX-License-Identifier: GPL-3.0-or-later
// Dense matrix products through BLAS, whose kernels are chosen at run time for the processor.
#pragma once

#include <string>

#include "supple/core/types.h"

namespace supple {

enum class Op { none, transpose };

/// C = alpha op(A) op(B) + beta C, row-major, float or double.
/// With beta 0, C is resized; otherwise it must have the product's shape.
/// Errors: `wrong_shape` where the inner sizes differ.
template <class Scalar>
void gemm(Scalar alpha, const RowMatrix<Scalar>& a, Op op_a, const RowMatrix<Scalar>& b, Op op_b,
          Scalar beta, RowMatrix<Scalar>& c);

/// op(A) op(B).
template <class Scalar>
RowMatrix<Scalar> product(const RowMatrix<Scalar>& a, Op op_a, const RowMatrix<Scalar>& b,
                          Op op_b) {
  RowMatrix<Scalar> c;
  gemm(Scalar(1), a, op_a, b, op_b, Scalar(0), c);
  return c;
}

template <class Scalar>
RowMatrix<Scalar> product(const RowMatrix<Scalar>& a, const RowMatrix<Scalar>& b) {
  return product(a, Op::none, b, Op::none);
}

/// The BLAS that answers, and the kernels it chose for this processor ("OpenBLAS ... SkylakeX").
std::string blas_name();

/// Eigenvalues, ascending, and eigenvectors of a symmetric matrix, in place of it (columns), by
/// LAPACK's divide and conquer. Errors: `no_convergence`, also for numbers that are not finite.
Eigen::VectorXd symmetric_eigen(Eigen::MatrixXd& matrix);

}  // namespace supple
