// SPDX-License-Identifier: GPL-3.0-or-later
// Matrix types shared by every layer. Points, fields and indices are rows (docs/conventions.md).
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>

namespace supple {

/// n x 3, one point a row.
using Points = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
/// m x 3, one triangle a row: three 0-based vertex indices, counter-clockwise seen from outside.
using Faces = Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>;
/// m x 9, one 3x3 matrix a row, itself row-major. The same bytes are a 3m x 3 stack (`stacked`).
using MatrixField = Eigen::Matrix<double, Eigen::Dynamic, 9, Eigen::RowMajor>;
/// 3x3, row-major, so that a row of a MatrixField maps onto it.
using Matrix3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using SparseMatrix = Eigen::SparseMatrix<double>;
using SparseRowMatrix = Eigen::SparseMatrix<double, Eigen::RowMajor>;

/// Dense row-major matrix of any scalar: features are rows x channels.
template <class Scalar>
using RowMatrix = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The numbers something is calculated with, where there is a choice: double or float.
enum class Precision { full, single };

/// Face `f` of a field as a 3x3 matrix, writable.
inline Eigen::Map<Matrix3> matrix_at(MatrixField& field, Eigen::Index f) {
  return Eigen::Map<Matrix3>(field.row(f).data());
}
inline Eigen::Map<const Matrix3> matrix_at(const MatrixField& field, Eigen::Index f) {
  return Eigen::Map<const Matrix3>(field.row(f).data());
}

/// The 3m x 3 view of an m x 9 field: the layout gradient and divergence work on.
inline Eigen::Map<const Points> stacked(const MatrixField& field) {
  return Eigen::Map<const Points>(field.data(), 3 * field.rows(), 3);
}

}  // namespace supple
