// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/spectral/descriptors.h"

#include <algorithm>
#include <cmath>

namespace supple {
namespace {

// Eigenvalues of the constants of components, which rounding leaves above 0.
constexpr double kZero = 1e-6;

double area_of(const Eigenbasis& basis) { return basis.mass.sum(); }

RowMatrix<double> squares(const Eigenbasis& basis) {
  return area_of(basis) * basis.functions.cwiseAbs2();
}

RowMatrix<double> products(const Eigenbasis& basis, int vertex) {
  return area_of(basis) * basis.functions * basis.functions.row(vertex).asDiagonal();
}

// k x times.
RowMatrix<double> heat_weights(const Eigenbasis& basis, const Eigen::VectorXd& times) {
  return (-area_of(basis) * basis.values * times.transpose()).array().exp().matrix();
}

// k x energies; columns sum to 1.
RowMatrix<double> wave_weights(const Eigenbasis& basis, const Eigen::VectorXd& energies,
                               double sigma) {
  RowMatrix<double> weights = RowMatrix<double>::Zero(basis.size(), energies.size());
  for (Eigen::Index i = 0; i < basis.size(); ++i) {
    const double value = area_of(basis) * basis.values[i];
    if (value > kZero) {
      weights.row(i) =
          (-(energies.array() - std::log(value)).square() / (2.0 * sigma * sigma)).exp();
    }
  }
  const Eigen::RowVectorXd sums = weights.colwise().sum().cwiseMax(1e-300);
  return weights * sums.cwiseInverse().asDiagonal();
}

}  // namespace

RowMatrix<double> heat_kernel_signature(const Eigenbasis& basis, const Eigen::VectorXd& times) {
  return squares(basis) * heat_weights(basis, times);
}

RowMatrix<double> wave_kernel_signature(const Eigenbasis& basis, const Eigen::VectorXd& energies,
                                        double sigma) {
  return squares(basis) * wave_weights(basis, energies, sigma);
}

RowMatrix<double> heat_kernel(const Eigenbasis& basis, int vertex, const Eigen::VectorXd& times) {
  return products(basis, vertex) * heat_weights(basis, times);
}

RowMatrix<double> wave_kernel(const Eigenbasis& basis, int vertex, const Eigen::VectorXd& energies,
                              double sigma) {
  return products(basis, vertex) * wave_weights(basis, energies, sigma);
}

WaveEnergies wave_energies(const Eigenbasis& a, const Eigenbasis& b, int count) {
  double low = 0.0, high = 1e300;
  for (const Eigenbasis* basis : {&a, &b}) {
    const Eigen::VectorXd values = area_of(*basis) * basis->values;
    const auto first =
        std::find_if(values.begin(), values.end(), [](double v) { return v > kZero; });
    low = std::max(low, first == values.end() ? kZero : *first);
    high = std::min(high, std::max(values[values.size() - 1], kZero));
  }
  low = std::log(std::min(low, high));
  high = std::max(std::log(high), low + 1e-3);
  return {Eigen::VectorXd::LinSpaced(count, low, high), 7.0 * (high - low) / count};
}

}  // namespace supple
