// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/soft_map.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "softmax.h"
#include "supple/core/dense.h"
#include "supple/core/error.h"
#include "supple/core/nearest_rows.h"

namespace supple {
namespace {

// Numbers in a block: enough rows for BLAS to be at its best with some 10,000 columns.
constexpr Eigen::Index kBlockNumbers = Eigen::Index{1} << 20;

Eigen::VectorXd row_lengths(const RowMatrix<double>& features, const char* whose) {
  Eigen::VectorXd lengths(features.rows());
  for (Eigen::Index i = 0; i < features.rows(); ++i) {
    lengths[i] = features.row(i).stableNorm();
    if (!std::isfinite(lengths[i]) || lengths[i] == 0.0) {
      throw Error(ErrorCode::not_finite,
                  "Row " + std::to_string(i) + " of the " + whose + "'s features " +
                      (lengths[i] == 0.0 ? "is 0 and has no direction"
                                         : "holds NaN or infinity, or is too long") +
                      ". Check the feature extractor.");
    }
  }
  return lengths;
}

// From the gradient with respect to rows of length 1 to that with respect to what they were.
void through_division(const RowMatrix<double>& unit, const Eigen::VectorXd& lengths,
                      RowMatrix<double>& grad) {
#pragma omp parallel for schedule(static)
  for (Eigen::Index i = 0; i < grad.rows(); ++i) {
    grad.row(i) = (grad.row(i) - unit.row(i) * unit.row(i).dot(grad.row(i))) / lengths[i];
  }
}

void check_rows(const RowMatrix<double>& values, Eigen::Index rows, const char* what) {
  if (values.rows() != rows) {
    throw Error(ErrorCode::wrong_shape, std::string(what) + " have " +
                                            std::to_string(values.rows()) + " rows for " +
                                            std::to_string(rows) + " vertices.");
  }
}

}  // namespace

SoftMap::SoftMap(const RowMatrix<double>& source, const RowMatrix<double>& target,
                 double temperature)
    : temperature_(temperature) {
  if (source.cols() != target.cols() || source.size() == 0 || target.size() == 0) {
    throw Error(ErrorCode::wrong_shape,
                "A soft map needs as many features of both surfaces, at least one; these are " +
                    std::to_string(source.rows()) + " x " + std::to_string(source.cols()) +
                    " and " + std::to_string(target.rows()) + " x " +
                    std::to_string(target.cols()) + ".");
  }
  if (!std::isfinite(temperature) || temperature <= 0.0) {
    throw Error(ErrorCode::bad_option, "The temperature of a soft map is " +
                                           std::to_string(temperature) +
                                           "; it must be a number above 0.");
  }
  source_length_ = row_lengths(source, "source");
  target_length_ = row_lengths(target, "target");
  source_ = source_length_.cwiseInverse().asDiagonal() * source;
  target_ = target_length_.cwiseInverse().asDiagonal() * target;
  block_rows_ = std::clamp<Eigen::Index>(kBlockNumbers / target.rows(), 1, source.rows());
}

RowMatrix<double> SoftMap::rows_of_map(const RowMatrix<double>& source) const {
  RowMatrix<double> map = product(source, Op::none, target_, Op::transpose);
#pragma omp parallel for schedule(static)
  for (Eigen::Index i = 0; i < map.rows(); ++i) {
    softmax(map.row(i).data(), map.cols(), temperature_);
  }
  return map;
}

template <class Step>
void SoftMap::over_blocks(const ProgressRange& progress, const Step& step) const {
  for (Eigen::Index begin = 0; begin < rows(); begin += block_rows_) {
    progress.report(static_cast<double>(begin) / static_cast<double>(rows()));
    step(begin, std::min(block_rows_, rows() - begin));
  }
  progress.report(1.0);
}

RowMatrix<double> SoftMap::apply(const RowMatrix<double>& values, ProgressRange progress) const {
  check_rows(values, cols(), "The values to pull back");
  RowMatrix<double> pulled(rows(), values.cols());
  over_blocks(progress, [&](Eigen::Index begin, Eigen::Index count) {
    pulled.middleRows(begin, count) =
        product(rows_of_map(source_.middleRows(begin, count)), values);
  });
  return pulled;
}

RowMatrix<double> SoftMap::apply_backward(const RowMatrix<double>& grad,
                                          ProgressRange progress) const {
  check_rows(grad, rows(), "The gradients of what was pulled back");
  RowMatrix<double> result = RowMatrix<double>::Zero(cols(), grad.cols());
  over_blocks(progress, [&](Eigen::Index begin, Eigen::Index count) {
    gemm(1.0, rows_of_map(source_.middleRows(begin, count)), Op::transpose,
         RowMatrix<double>(grad.middleRows(begin, count)), Op::none, 1.0, result);
  });
  return result;
}

SoftMap::Gradient SoftMap::backward(const RowMatrix<double>& values, const RowMatrix<double>& grad,
                                    ProgressRange progress) const {
  check_rows(values, cols(), "The values to pull back");
  check_rows(grad, rows(), "The gradients of what was pulled back");
  if (values.cols() != grad.cols()) {
    throw Error(ErrorCode::wrong_shape, std::to_string(grad.cols()) +
                                            " columns of gradients were given for " +
                                            std::to_string(values.cols()) + " of values.");
  }
  Gradient gradient{RowMatrix<double>(rows(), source_.cols()),
                    RowMatrix<double>::Zero(cols(), target_.cols())};
  over_blocks(progress, [&](Eigen::Index begin, Eigen::Index count) {
    const RowMatrix<double> source = source_.middleRows(begin, count);
    RowMatrix<double> map = rows_of_map(source);
    const RowMatrix<double> grad_map =
        product(RowMatrix<double>(grad.middleRows(begin, count)), Op::none, values, Op::transpose);
    // In place of P: the gradient with respect to F1 F2^T, of which a row's sum is 0.
#pragma omp parallel for schedule(static)
    for (Eigen::Index i = 0; i < count; ++i) {
      const double mean = map.row(i).dot(grad_map.row(i));
      map.row(i).array() *= (grad_map.row(i).array() - mean) / temperature_;
    }
    gradient.source.middleRows(begin, count) = product(map, target_);
    gemm(1.0, map, Op::transpose, source, Op::none, 1.0, gradient.target);
  });
  through_division(source_, source_length_, gradient.source);
  through_division(target_, target_length_, gradient.target);
  return gradient;
}

Eigen::VectorXi SoftMap::hard_map(ProgressRange progress) const {
  return nearest_rows(source_, target_,
                      progress);  // the nearest of length 1 has the largest product
}

}  // namespace supple
