// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/spectral/map_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "supple/core/dense.h"
#include "supple/core/nearest_rows.h"
#include "supple/core/tall.h"
#include "supple/spectral/functional_map.h"

namespace supple {
namespace {

// Of the system's mean diagonal: solvable whatever the constraints leave open.
constexpr double kRidge = 1e-9;

RowMatrix<double> solved(RowMatrix<double> system, const RowMatrix<double>& rhs) {
  system.diagonal().array() += kRidge * system.diagonal().mean() + 1e-300;
  return Eigen::LDLT<Eigen::MatrixXd>(system).solve(Eigen::MatrixXd(rhs));
}

}  // namespace

RowMatrix<double> fit_functional_map(const Eigen::VectorXd& source_values,
                                     const Eigen::VectorXd& target_values,
                                     const MapConstraints& constraints) {
  const Eigen::Index ks = source_values.size(), kt = target_values.size();
  const RowMatrix<double>&a = constraints.source, &b = constraints.target;
  const double share = 1.0 / static_cast<double>(std::max<Eigen::Index>(1, a.cols()));
  const RowMatrix<double> gram = share * product(b, Op::none, b, Op::transpose);
  const RowMatrix<double> cross = share * product(a, Op::none, b, Op::transpose);
  const double largest = std::max(source_values.maxCoeff(), target_values.maxCoeff());
  RowMatrix<double> apart(ks, kt);
  for (Eigen::Index i = 0; i < ks; ++i) {
    apart.row(i) = ((target_values.array() - source_values[i]) / largest).square().transpose();
  }
  apart *= constraints.commuting;
  if (constraints.operators.empty()) {
    RowMatrix<double> map(ks, kt);
    for (Eigen::Index i = 0; i < ks; ++i) {
      RowMatrix<double> system = gram;
      system.diagonal() += apart.row(i).transpose();
      map.row(i) = solved(std::move(system), cross.row(i).transpose()).transpose();
    }
    return map;
  }
  // Unknowns: the rows of C one after the other.
  RowMatrix<double> system = RowMatrix<double>::Zero(ks * kt, ks * kt);
  for (Eigen::Index i = 0; i < ks; ++i) {
    system.block(i * kt, i * kt, kt, kt) = gram;
    system.block(i * kt, i * kt, kt, kt).diagonal() += apart.row(i).transpose();
  }
  const double each =
      constraints.operator_weight / static_cast<double>(constraints.operators.size());
  for (const auto& [source, target] : constraints.operators) {
    const double size = (source.norm() + target.norm()) / 2.0;
    if (!(size > 0.0)) {
      continue;
    }
    RowMatrix<double> residual = RowMatrix<double>::Zero(ks * kt, ks * kt);  // of C T - S C
    for (Eigen::Index i = 0; i < ks; ++i) {
      residual.block(i * kt, i * kt, kt, kt) += target.transpose() / size;
      for (Eigen::Index l = 0; l < ks; ++l) {
        residual.block(i * kt, l * kt, kt, kt).diagonal().array() -= source(i, l) / size;
      }
    }
    gemm(each, residual, Op::transpose, residual, Op::none, 1.0, system);
  }
  const RowMatrix<double> flat = Eigen::Map<const RowMatrix<double>>(cross.data(), ks * kt, 1);
  const RowMatrix<double> solution = solved(std::move(system), flat);
  return Eigen::Map<const RowMatrix<double>>(solution.data(), ks, kt);
}

RowMatrix<double> orientation_operator(const Eigenbasis& basis, const Faces& faces,
                                       const Eigen::VectorXd& field, Eigen::Index count) {
  // On a face, n . (grad f x grad h) = ((f1 - f0)(h2 - h0) - (f2 - f0)(h1 - h0)) / 2A.
  const double scale = std::sqrt(basis.mass.sum());
  RowMatrix<double> mean(faces.rows(), count), turned(faces.rows(), count);
#pragma omp parallel for schedule(static)
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    const auto a = basis.functions.row(faces(f, 0)).head(count);
    const auto b = basis.functions.row(faces(f, 1)).head(count);
    const auto c = basis.functions.row(faces(f, 2)).head(count);
    const double fb = field[faces(f, 1)] - field[faces(f, 0)];
    const double fc = field[faces(f, 2)] - field[faces(f, 0)];
    mean.row(f) = scale / 3.0 * (a + b + c);
    turned.row(f) = scale / 2.0 * (fb * (c - a) - fc * (b - a));
  }
  return tall_product<double>({mean}, turned);
}

SampledFunctions sampled_functions(const Eigenbasis& basis, const Eigen::VectorXi& vertices,
                                   Eigen::Index count) {
  const double area = basis.mass.sum();
  return {std::sqrt(area) * basis.functions(vertices, Eigen::seqN(0, count)),
          Eigen::VectorXd::Constant(vertices.size(), 1.0 / static_cast<double>(vertices.size()))};
}

Eigen::VectorXi nearest_images(const RowMatrix<double>& source, const RowMatrix<double>& target,
                               const RowMatrix<double>& map, double scale, ProgressRange progress) {
  RowMatrix<double> images = RowMatrix<double>::Zero(target.rows(), map.rows());
  add_tall_product<double>(scale, {target.leftCols(map.cols())}, map.transpose(), images);
  return nearest_rows(source.leftCols(map.rows()), images, progress);
}

Eigen::VectorXi sampled_point_map(const SampledFunctions& source, const SampledFunctions& target,
                                  const RowMatrix<double>& map) {
  return nearest_images(source.functions, target.functions, map, 1.0);
}

RowMatrix<double> sampled_functional_map(const SampledFunctions& source,
                                         const SampledFunctions& target, const Eigen::VectorXi& map,
                                         Eigen::Index count) {
  const RowMatrix<double> functions = source.functions.leftCols(count);
  const RowMatrix<double> weighted = source.weights.asDiagonal() * functions;
  const RowMatrix<double> pulled = target.functions(map, Eigen::seqN(0, count));
  return solved(tall_product<double>({weighted}, functions),
                tall_product<double>({weighted}, pulled));
}

RowMatrix<double> sampled_zoomout(const SampledFunctions& source, const SampledFunctions& target,
                                  RowMatrix<double> map, Eigen::Index to, Eigen::Index step,
                                  const std::vector<std::pair<int, int>>& fixed,
                                  const ProgressRange& progress) {
  const Eigen::Index from = std::min(map.rows(), map.cols());
  for (Eigen::Index count = from; count < to;) {
    progress.report(static_cast<double>(count - from) / static_cast<double>(to - from));
    count = std::min(count + step, to);
    Eigen::VectorXi rows = sampled_point_map(source, target, map);
    for (const auto& [from, at] : fixed) {
      rows[from] = at;
    }
    map = sampled_functional_map(source, target, rows, count);
  }
  return map;
}

}  // namespace supple
