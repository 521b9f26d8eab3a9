// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/functional_map_loss.h"

#include <string>

#include "supple/core/dense.h"
#include "supple/core/error.h"

namespace supple {
namespace {

void check_shape(const RowMatrix<double>& matrix, Eigen::Index rows, Eigen::Index cols,
                 const char* what) {
  if (matrix.rows() != rows || matrix.cols() != cols) {
    throw Error(ErrorCode::wrong_shape, std::string(what) + " is " + std::to_string(matrix.rows()) +
                                            " x " + std::to_string(matrix.cols()) +
                                            "; it must be " + std::to_string(rows) + " x " +
                                            std::to_string(cols) + ".");
  }
}

}  // namespace

double orthogonality_loss(const RowMatrix<double>& map, double weight, RowMatrix<double>* grad) {
  RowMatrix<double> error = product(map, Op::transpose, map, Op::none);
  error.diagonal().array() -= 1.0;
  if (grad != nullptr) {
    check_shape(*grad, map.rows(), map.cols(), "The gradient of a functional map");
    gemm(4.0 * weight, map, Op::none, error, Op::none, 1.0, *grad);
  }
  return error.squaredNorm();
}

double coupling_loss(const RowMatrix<double>& map, const RowMatrix<double>& other, double weight,
                     RowMatrix<double>* grad, RowMatrix<double>* grad_other) {
  check_shape(other, map.rows(), map.cols(), "The functional map of the soft map");
  const RowMatrix<double> error = map - other;
  if (grad != nullptr) {
    check_shape(*grad, map.rows(), map.cols(), "The gradient of a functional map");
    *grad += 2.0 * weight * error;
  }
  if (grad_other != nullptr) {
    check_shape(*grad_other, map.rows(), map.cols(), "The gradient of a functional map");
    *grad_other -= 2.0 * weight * error;
  }
  return error.squaredNorm();
}

double bijectivity_loss(const RowMatrix<double>& map, const RowMatrix<double>& back, double weight,
                        RowMatrix<double>* grad, RowMatrix<double>* grad_back) {
  check_shape(back, map.cols(), map.rows(), "The functional map back");
  RowMatrix<double> error = product(map, back);
  error.diagonal().array() -= 1.0;
  if (grad != nullptr) {
    check_shape(*grad, map.rows(), map.cols(), "The gradient of a functional map");
    gemm(2.0 * weight, error, Op::none, back, Op::transpose, 1.0, *grad);
  }
  if (grad_back != nullptr) {
    check_shape(*grad_back, back.rows(), back.cols(), "The gradient of a functional map");
    gemm(2.0 * weight, map, Op::transpose, error, Op::none, 1.0, *grad_back);
  }
  return error.squaredNorm();
}

}  // namespace supple
