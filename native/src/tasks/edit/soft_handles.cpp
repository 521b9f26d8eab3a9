// SPDX-License-Identifier: GPL-3.0-or-later
#include "soft_handles.h"

namespace supple {

SparseMatrix SoftHandles::added_to(const SparseMatrix& laplacian) const {
  SparseMatrix result = laplacian;
  for (Eigen::Index i = 0; i < vertices.size(); ++i) {
    result.coeffRef(vertices[i], vertices[i]) += pull[i];
  }
  return result;
}

void SoftHandles::add_residual(const Points& moved, const Points& targets, Points& residual) const {
  for (Eigen::Index i = 0; i < vertices.size(); ++i) {
    residual.row(vertices[i]) += pull[i] * (targets.row(i) - moved.row(vertices[i]));
  }
}

double pull_of(double weight) {
  constexpr double kEven = 4.0;  // 2 pi / log(size / size of a handle) is what a membrane resists
  return kEven * weight / (1.0 - weight);
}

double compliance_of(double weight, Eigen::Index guides) {
  constexpr double kEven = 0.01;  // d^2 log(1 / d) / 8 pi, at d of half the surface's size
  return kEven * static_cast<double>(guides) * (1.0 - weight) / weight;
}

double PulledEnergy::evaluate(const Points& moved, Points& gradient) const {
  double value = energy_.evaluate(moved, gradient);
  for (Eigen::Index i = 0; i < soft_.vertices.size(); ++i) {
    const int vertex = soft_.vertices[i];
    const double pull = stiffness() * soft_.pull[i];
    const Eigen::RowVector3d away = moved.row(vertex) - targets_.row(i);
    value += 0.5 * pull * away.squaredNorm();
    gradient.row(vertex) += pull * away;
  }
  return value;
}

}  // namespace supple
