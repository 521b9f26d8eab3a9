// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/feature_map.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <atomic>
#include <cmath>

#include "supple/core/dense.h"
#include "supple/core/error.h"

namespace supple {
namespace {

std::string shape(const RowMatrix<double>& matrix) {
  return std::to_string(matrix.rows()) + " x " + std::to_string(matrix.cols());
}

void check(const RowMatrix<double>& source, const RowMatrix<double>& target,
           const RowMatrix<double>& penalties) {
  if (source.cols() != target.cols() || penalties.rows() != source.rows() ||
      penalties.cols() != target.rows()) {
    throw Error(ErrorCode::wrong_shape,
                "Coefficients of " + shape(source) + " and " + shape(target) +
                    " and penalties of " + shape(penalties) +
                    " do not fit: k_s x c, k_t x c and k_s x k_t are needed.");
  }
  if (!source.allFinite() || !target.allFinite() || !penalties.allFinite()) {
    throw Error(ErrorCode::not_finite,
                "The coefficients or penalties of a functional map hold NaN or infinity. Check the "
                "feature extractor.");
  }
}

// Row i solved with A_t A_t^T + diag D_i for every row of `right` (k_s x k_t).
RowMatrix<double> solve_rows(const RowMatrix<double>& target, const RowMatrix<double>& penalties,
                             const RowMatrix<double>& right) {
  const RowMatrix<double> gram = product(target, Op::none, target, Op::transpose);
  RowMatrix<double> solution(right.rows(), right.cols());
  std::atomic<Eigen::Index> failed{-1};  // nothing may be thrown out of the loop
#pragma omp parallel for schedule(static)
  for (Eigen::Index i = 0; i < right.rows(); ++i) {
    Eigen::MatrixXd system = gram;
    system.diagonal() += penalties.row(i).transpose();
    const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> factor(system);
    if (factor.info() != Eigen::Success) {
      failed = i;
      continue;
    }
    solution.row(i) = factor.solve(right.row(i).transpose()).transpose();
  }
  if (failed >= 0) {
    throw Error(ErrorCode::not_positive_definite,
                "Row " + std::to_string(failed) + " of the functional map is not determined by " +
                    std::to_string(target.cols()) +
                    " features. Use more, different features or a larger penalty.");
  }
  return solution;
}

}  // namespace

const char* to_string(MapPenalty penalty) {
  return penalty == MapPenalty::resolvent ? "resolvent" : "commutator";
}

MapPenalty map_penalty(const std::string& name) {
  if (name == "resolvent") {
    return MapPenalty::resolvent;
  }
  if (name == "commutator") {
    return MapPenalty::commutator;
  }
  throw Error(ErrorCode::bad_option,
              "'" + name + "' is no penalty of a map. Use 'resolvent' or 'commutator'.");
}

RowMatrix<double> map_penalties(const Eigen::VectorXd& source_values,
                                const Eigen::VectorXd& target_values,
                                const FeatureMapOptions& options) {
  if (!(options.weight >= 0.0) || !std::isfinite(options.weight) || !(options.exponent > 0.0) ||
      !std::isfinite(options.exponent)) {
    throw Error(ErrorCode::bad_option, "The penalty of a map has weight " +
                                           std::to_string(options.weight) + " and exponent " +
                                           std::to_string(options.exponent) +
                                           "; they must be 0 or more, and above 0.");
  }
  if (source_values.size() == 0 || target_values.size() == 0) {
    throw Error(ErrorCode::wrong_shape, "A map needs at least one eigenvalue of both surfaces.");
  }
  if (!source_values.allFinite() || !target_values.allFinite() || source_values.minCoeff() < 0.0 ||
      target_values.minCoeff() < 0.0) {
    throw Error(ErrorCode::not_finite,
                "Eigenvalues are negative, NaN or infinite. Take those of a Laplacian.");
  }
  const double largest = std::max(source_values.maxCoeff(), target_values.maxCoeff());
  const double scale = largest > 0.0 ? 1.0 / largest : 1.0;
  RowMatrix<double> penalties(source_values.size(), target_values.size());
  for (Eigen::Index i = 0; i < penalties.rows(); ++i) {
    for (Eigen::Index j = 0; j < penalties.cols(); ++j) {
      double a = scale * source_values[i], b = scale * target_values[j];
      if (options.penalty == MapPenalty::resolvent) {
        a = std::pow(a, options.exponent);
        b = std::pow(b, options.exponent);
        // |1 / (a - i) - 1 / (b - i)| = |a - b| / |a - i| / |b - i|
        penalties(i, j) = (a - b) * (a - b) / ((a * a + 1.0) * (b * b + 1.0));
      } else {
        penalties(i, j) = (a - b) * (a - b);
      }
    }
  }
  return options.weight * penalties;
}

RowMatrix<double> feature_map(const RowMatrix<double>& source, const RowMatrix<double>& target,
                              const RowMatrix<double>& penalties) {
  check(source, target, penalties);
  return solve_rows(target, penalties, product(source, Op::none, target, Op::transpose));
}

FeatureMapGradient feature_map_backward(const RowMatrix<double>& source,
                                        const RowMatrix<double>& target,
                                        const RowMatrix<double>& penalties,
                                        const RowMatrix<double>& map,
                                        const RowMatrix<double>& grad) {
  check(source, target, penalties);
  if (map.rows() != penalties.rows() || map.cols() != penalties.cols() ||
      grad.rows() != penalties.rows() || grad.cols() != penalties.cols()) {
    throw Error(ErrorCode::wrong_shape, "A map of " + shape(map) + " and its gradient of " +
                                            shape(grad) + " must both be " + shape(penalties) +
                                            ".");
  }
  // With K_i y_i = g_i, the gradient of A_t (A_s)_i is y_i and that of K_i is -y_i c_i^T.
  const RowMatrix<double> adjoint = solve_rows(target, penalties, grad);
  const RowMatrix<double> of_gram = product(adjoint, Op::transpose, map, Op::none);
  FeatureMapGradient gradient{product(adjoint, target),
                              product(adjoint, Op::transpose, source, Op::none)};
  gemm(-1.0, RowMatrix<double>(of_gram + of_gram.transpose()), Op::none, target, Op::none, 1.0,
       gradient.target);
  return gradient;
}

}  // namespace supple
