// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/jacobian_loss.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <string>

#include "supple/core/error.h"

namespace supple {
namespace {

// Derivatives of the determinant with respect to each entry.
Matrix3 cofactors(const Matrix3& j) {
  Matrix3 result;
  for (int i = 0; i < 3; ++i) {
    result.row(i) = j.row((i + 1) % 3).cross(j.row((i + 2) % 3));
  }
  return result;
}

}  // namespace

JacobianLossValues jacobian_loss(const SurfaceOperators& source, const SparseRowMatrix& adjacency,
                                 const JacobianWeights& weights, const MatrixField& rough,
                                 const MatrixField& predicted, JacobianLossGradient* gradient) {
  const Eigen::Index m = source.faces.rows();
  if (rough.rows() != m || predicted.rows() != m || adjacency.rows() != m ||
      adjacency.cols() != m) {
    throw Error(ErrorCode::wrong_shape,
                std::to_string(predicted.rows()) + " predicted and " +
                    std::to_string(rough.rows()) + " rough Jacobians and an adjacency of " +
                    std::to_string(adjacency.rows()) + " faces were given for a surface of " +
                    std::to_string(m) + " faces.");
  }
  if (!rough.allFinite() || !predicted.allFinite()) {
    throw Error(ErrorCode::not_finite,
                "The predicted or rough Jacobians hold NaN or infinity. Check the network; where "
                "training diverges, lower its learning rate.");
  }
  const Eigen::VectorXd& areas = source.face_areas;
  const MatrixField fit = predicted - rough;
  const MatrixField roughness = predicted - MatrixField(adjacency * predicted);
  Eigen::VectorXd growth(m);
  for (Eigen::Index f = 0; f < m; ++f) {
    growth[f] = matrix_at(predicted, f).determinant() - 1.0;
  }

  JacobianLossValues loss;
  loss.fit = areas.dot(fit.rowwise().squaredNorm());
  loss.smoothness = areas.dot(roughness.rowwise().squaredNorm());
  loss.determinant = areas.dot(growth.cwiseAbs2());
  loss.total = weights.fit * loss.fit + weights.smoothness * loss.smoothness +
               weights.determinant * loss.determinant;

  if (gradient != nullptr) {
    const MatrixField grad_fit = 2.0 * weights.fit * (areas.asDiagonal() * fit);
    const MatrixField grad_roughness = 2.0 * weights.smoothness * (areas.asDiagonal() * roughness);
    gradient->rough = -grad_fit;
    gradient->predicted =
        grad_fit + grad_roughness - MatrixField(adjacency.transpose() * grad_roughness);
    for (Eigen::Index f = 0; f < m; ++f) {
      matrix_at(gradient->predicted, f) +=
          2.0 * weights.determinant * areas[f] * growth[f] * cofactors(matrix_at(predicted, f));
    }
  }
  return loss;
}

}  // namespace supple
