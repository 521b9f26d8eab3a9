// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/spectral/recovery.h"

#include <cmath>
#include <sstream>
#include <utility>

#include "supple/core/error.h"

namespace supple {
namespace {

constexpr std::pair<RecoveryForm, const char*> kForms[] = {
    {RecoveryForm::product, "product"},
    {RecoveryForm::literal, "literal"},
};

void check_option(bool right, const char* name, double value, const char* range) {
  if (!right) {
    std::ostringstream message;
    message << "The recovery's " << name << " is " << value << "; it must be " << range << ".";
    throw Error(ErrorCode::bad_option, message.str());
  }
}

void check(const SparseMatrix& laplacian, const Eigen::VectorXd& mass,
           const RecoveryOptions& options) {
  const Eigen::Index n = mass.size();
  if (laplacian.rows() != n || laplacian.cols() != n) {
    throw Error(ErrorCode::wrong_shape, "The Laplacian is " + std::to_string(laplacian.rows()) +
                                            " x " + std::to_string(laplacian.cols()) +
                                            " for the masses of " + std::to_string(n) +
                                            " vertices; both must be of the same mesh.");
  }
  const auto positive = [](double value) { return std::isfinite(value) && value > 0.0; };
  if (options.form == RecoveryForm::product) {
    check_option(positive(options.pull), "pull", options.pull, "positive");
  } else {
    check_option(positive(options.point_weight), "point weight", options.point_weight, "positive");
    check_option(options.jacobian_weight == 0.0 || positive(options.jacobian_weight),
                 "Jacobian weight", options.jacobian_weight, "0 or positive");
  }
}

void check_rows(const char* what, Eigen::Index rows, Eigen::Index expected, const char* of) {
  if (rows != expected) {
    throw Error(ErrorCode::wrong_shape, "There are " + std::to_string(rows) + " " + what +
                                            " for a mesh of " + std::to_string(expected) + " " +
                                            of + ".");
  }
}

}  // namespace

const char* to_string(RecoveryForm form) {
  for (const auto& [value, name] : kForms) {
    if (value == form) {
      return name;
    }
  }
  return "";
}

RecoveryForm recovery_form(const std::string& name) {
  for (const auto& [value, known] : kForms) {
    if (name == known) {
      return value;
    }
  }
  throw Error(ErrorCode::bad_option,
              "There is no recovery '" + name + "'. Use 'product' or 'literal'.");
}

SparseMatrix EmbeddingRecovery::system(const SparseMatrix& laplacian, const Eigen::VectorXd& mass,
                                       const RecoveryOptions& options) {
  check(laplacian, mass, options);
  const Eigen::VectorXd unit_mass = mass / mass.sum();
  const bool literal = options.form == RecoveryForm::literal;
  SparseMatrix result = laplacian;
  if (literal) {
    const SparseMatrix weighted = unit_mass.asDiagonal() * laplacian;
    const SparseMatrix wide = laplacian * weighted;
    result += options.jacobian_weight * wide;
  }
  const double pull = literal ? options.point_weight : options.pull;
  for (Eigen::Index i = 0; i < unit_mass.size(); ++i) {
    result.coeffRef(i, i) += pull * unit_mass[i];  // in place: the pattern stays the Laplacian's
  }
  result.makeCompressed();
  return result;
}

EmbeddingRecovery::EmbeddingRecovery(const SparseMatrix& laplacian, const Eigen::VectorXd& mass,
                                     SparseMatrix divergence, const RecoveryOptions& options,
                                     std::shared_ptr<const SymbolicCholesky> symbolic)
    : options_(options),
      mass_(mass / mass.sum()),
      divergence_(std::move(divergence)),
      factor_(system(laplacian, mass, options), std::move(symbolic)) {
  check_rows("rows of the divergence", divergence_.rows(), mass.size(), "vertices");
  if (options.form == RecoveryForm::literal) {
    laplacian_ = laplacian;
  }
}

EmbeddingRecovery::EmbeddingRecovery(const SurfaceOperators& operators,
                                     const RecoveryOptions& options,
                                     std::shared_ptr<const SymbolicCholesky> symbolic)
    : EmbeddingRecovery(operators.laplacian, operators.mass, operators.divergence, options,
                        std::move(symbolic)) {}

Points EmbeddingRecovery::solve(const Points& coarse, const MatrixField& jacobians) const {
  check_rows("coarse points", coarse.rows(), mass_.size(), "vertices");
  check_rows("Jacobians", jacobians.rows(), divergence_.cols() / 3, "faces");
  const Points d = divergence_ * stacked(jacobians);
  if (options_.form == RecoveryForm::literal) {
    const Points weighted = mass_.asDiagonal() * d;
    const Points pulled = options_.point_weight * (mass_.asDiagonal() * coarse);
    return factor_.solve(pulled + options_.jacobian_weight * (laplacian_ * weighted));
  }
  const auto step = [&](const Points& near) -> Points {
    return factor_.solve(options_.pull * (mass_.asDiagonal() * near) + d);
  };
  return step(step(coarse));
}

}  // namespace supple
