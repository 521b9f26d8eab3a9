// SPDX-License-Identifier: GPL-3.0-or-later
// Products of the DiffusionNet's features, a row a vertex, shared among threads by rows.
#pragma once

#include "supple/core/tall.h"
#include "supple/learning/diffusion_net.h"

namespace supple::diffusion {

/// A C; the pieces of A lie side by side.
template <class Scalar>
RowMatrix<Scalar> times(const TallPieces<Scalar>& a, const RowMatrix<Scalar>& c) {
  RowMatrix<Scalar> result = RowMatrix<Scalar>::Zero(a.front().rows(), c.cols());
  add_tall_product<Scalar>(Scalar(1), a, c, result);
  return result;
}

template <class Scalar>
RowMatrix<Scalar> times(const RowMatrix<Scalar>& a, const RowMatrix<Scalar>& c) {
  return times<Scalar>(TallPieces<Scalar>{a}, c);
}

/// A^T B.
template <class Scalar>
RowMatrix<Scalar> transposed_times(const RowMatrix<Scalar>& a, const RowMatrix<Scalar>& b) {
  return tall_product<Scalar>(TallPieces<Scalar>{a}, b);
}

/// A sparse matrix times n x c.
template <class Scalar>
RowMatrix<Scalar> times(const typename DiffusionContext<Scalar>::Gradient& a,
                        const RowMatrix<Scalar>& b) {
  RowMatrix<Scalar> result(a.rows(), b.cols());
#pragma omp parallel for schedule(static)
  for (Eigen::Index i = 0; i < a.rows(); ++i) {
    result.row(i).setZero();
    for (typename DiffusionContext<Scalar>::Gradient::InnerIterator it(a, i); it; ++it) {
      result.row(i) += it.value() * b.row(it.col());
    }
  }
  return result;
}

/// The gradient of x W + b for W and b, added to `gradient`, and the one for x, returned.
template <class Scalar>
RowMatrix<Scalar> linear_backward(const typename DiffusionParameters<Scalar>::Layer& layer,
                                  const TallPieces<Scalar>& x, const RowMatrix<Scalar>& grad,
                                  typename DiffusionParameters<Scalar>::Layer& gradient) {
  gradient.weight += tall_product<Scalar>(x, grad);
  gradient.bias += grad.colwise().sum();
  return times<Scalar>(grad, RowMatrix<Scalar>(layer.weight.transpose()));
}

}  // namespace supple::diffusion
