// SPDX-License-Identifier: GPL-3.0-or-later
// Products of tall, thin matrices: many rows, some hundred columns. General BLAS first copies such
// a matrix into blocks, which takes longer than the product.
#pragma once

#include <vector>

#include "supple/core/types.h"

namespace supple {

/// Some neighbouring columns of a row-major matrix, not copied.
template <class Scalar>
using TallBlock = Eigen::Ref<RowMatrix<Scalar>, 0, Eigen::OuterStride<>>;
template <class Scalar>
using ConstTallBlock = Eigen::Ref<const RowMatrix<Scalar>, 0, Eigen::OuterStride<>>;

/// A tall matrix in pieces, column blocks one beside the other: narrow pieces are read from one end
/// to the other, where the rows of one wide matrix would each lie on a memory page of their own.
template <class Scalar>
using TallPieces = std::vector<ConstTallBlock<Scalar>>;

/// A^T B (k x c) of A (n x k) and B (n x c), float or double. Some rows at a time, whose sums are
/// added in order: the same bytes for any number of threads.
/// Errors: `wrong_shape`.
template <class Scalar>
RowMatrix<Scalar> tall_product(const TallPieces<Scalar>& a, const ConstTallBlock<Scalar>& b);

/// B += alpha A C of A (n x k), C (k x c) and B (n x c); also the same bytes for any number of
/// threads. Errors: `wrong_shape`.
template <class Scalar>
void add_tall_product(Scalar alpha, const TallPieces<Scalar>& a, const RowMatrix<Scalar>& c,
                      TallBlock<Scalar> b);

}  // namespace supple
