// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/spectral/sampling.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <limits>
#include <numeric>
#include <vector>

#include "supple/core/tall.h"

namespace supple {
namespace {

// Distances this close, relatively, are equal but for rounding.
constexpr double kTie = 1e-9;

}  // namespace

Eigen::VectorXi farthest_point_samples(const Points& points, Eigen::Index count) {
  const Eigen::Index n = points.rows();
  if (n <= count) {
    return Eigen::VectorXi::LinSpaced(n, 0, static_cast<int>(n) - 1);
  }
  const auto farthest = [&](const Eigen::VectorXd& distance) {
    int best = 0;
    for (int i = 1; i < n; ++i) {
      if (distance[i] > distance[best] * (1.0 + kTie)) {
        best = i;
      }
    }
    return best;
  };
  const Eigen::RowVector3d centre = points.colwise().mean();
  Eigen::VectorXd distance = (points.rowwise() - centre).rowwise().squaredNorm();
  std::vector<int> samples{farthest(distance)};
  distance.setConstant(std::numeric_limits<double>::max());
  while (static_cast<Eigen::Index>(samples.size()) < count) {
    const Eigen::RowVector3d last = points.row(samples.back());
    // Serial: a parallel loop's barriers, one a sample, cost more than they save.
    for (Eigen::Index i = 0; i < n; ++i) {
      distance[i] = std::min(distance[i], (points.row(i) - last).squaredNorm());
    }
    distance[samples.back()] =
        -1.0;  // chosen: never again, even where other points coincide with it
    samples.push_back(farthest(distance));
  }
  std::sort(samples.begin(), samples.end());
  return Eigen::Map<Eigen::VectorXi>(samples.data(), count);
}

template <class Scalar>
SpectralDomain<Scalar> full_domain(const Eigenbasis& basis, Eigen::Index count) {
  SpectralDomain<Scalar> domain;
  domain.functions = basis.functions.leftCols(count).template cast<Scalar>();
  domain.projector = (basis.functions.leftCols(count).transpose() * basis.mass.asDiagonal())
                         .template cast<Scalar>();
  return domain;
}

template <class Scalar>
SpectralDomain<Scalar> sampled_domain(const Eigenbasis& basis, Eigen::Index count,
                                      const Points& points, const Eigen::VectorXi& samples) {
  if (samples.size() == basis.mass.size()) {
    return full_domain<Scalar>(basis, count);
  }
  Points centres(samples.size(), 3);
  RowMatrix<double> functions(samples.size(), count);
  for (Eigen::Index s = 0; s < samples.size(); ++s) {
    centres.row(s) = points.row(samples[s]);
    functions.row(s) = basis.functions.row(samples[s]).head(count);
  }
  Eigen::VectorXi owner(points.rows());
#pragma omp parallel for schedule(static)
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    const Eigen::RowVector3d point = points.row(i);
    double nearest = std::numeric_limits<double>::max();
    for (int s = 0; s < centres.rows(); ++s) {
      const double distance = (centres.row(s) - point).squaredNorm();
      if (distance < nearest * (1.0 - kTie)) {
        nearest = distance;
        owner[i] = s;
      }
    }
  }
  Eigen::VectorXd weight = Eigen::VectorXd::Zero(samples.size());
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    weight[owner[i]] += basis.mass[i];
  }
  const RowMatrix<double> weighted = weight.asDiagonal() * functions;
  // Not by Eigen, whose threads change the order of the sums.
  Eigen::MatrixXd gram = tall_product<double>({functions}, weighted);
  // The mass of a tiny separate piece can leave the Gram matrix near singular; this keeps it
  // solvable without moving a well-conditioned one.
  gram.diagonal().array() += 1e-10;
  SpectralDomain<Scalar> domain;
  domain.functions = functions.cast<Scalar>();
  domain.projector =
      Eigen::LDLT<Eigen::MatrixXd>(gram).solve(weighted.transpose()).template cast<Scalar>();
  return domain;
}

template SpectralDomain<float> full_domain<float>(const Eigenbasis&, Eigen::Index);
template SpectralDomain<double> full_domain<double>(const Eigenbasis&, Eigen::Index);
template SpectralDomain<float> sampled_domain<float>(const Eigenbasis&, Eigen::Index, const Points&,
                                                     const Eigen::VectorXi&);
template SpectralDomain<double> sampled_domain<double>(const Eigenbasis&, Eigen::Index,
                                                       const Points&, const Eigen::VectorXi&);

}  // namespace supple
