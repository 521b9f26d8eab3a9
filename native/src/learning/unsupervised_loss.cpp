// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/unsupervised_loss.h"

#include <string>

#include "supple/core/dense.h"
#include "supple/core/error.h"
#include "supple/core/tall.h"
#include "supple/geometry/face_adjacency.h"
#include "supple/geometry/jacobians.h"
#include "supple/learning/functional_map_loss.h"
#include "supple/learning/soft_map.h"

namespace supple {
namespace {

// A^T B of tall, thin matrices.
RowMatrix<double> transposed_times(const RowMatrix<double>& a, const RowMatrix<double>& b) {
  return tall_product<double>({a}, b);
}

template <class Scalar>
void check_features(const SurfacePair& surfaces, const FeaturePair<Scalar>& features) {
  for (size_t d = 0; d < 2; ++d) {
    const Eigen::Index n = surfaces[d]->functions.rows();
    if (features[d].rows() != n || features[d].cols() != features[0].cols()) {
      throw Error(ErrorCode::wrong_shape, "Surface " + std::to_string(d) + " of the pair has " +
                                              std::to_string(features[d].rows()) + " x " +
                                              std::to_string(features[d].cols()) + " features; " +
                                              std::to_string(n) + " x " +
                                              std::to_string(features[0].cols()) + " are needed.");
    }
  }
}

void check_shape(const Eigen::Index rows, const Eigen::Index cols, Eigen::Index right_rows,
                 Eigen::Index right_cols, size_t d, const char* what) {
  if (rows != right_rows || cols != right_cols) {
    throw Error(ErrorCode::wrong_shape, "Direction " + std::to_string(d) + ": " + what + " has " +
                                            std::to_string(rows) + " x " + std::to_string(cols) +
                                            " numbers instead of " + std::to_string(right_rows) +
                                            " x " + std::to_string(right_cols) + ".");
  }
}

void check_match(const SurfacePair& surfaces, const Match& match, bool as_gradient) {
  for (size_t d = 0; d < 2; ++d) {
    const MatchSurface &source = *surfaces[d], &target = *surfaces[1 - d];
    const auto check = [&](const auto& matrix, Eigen::Index rows, Eigen::Index cols,
                           const char* what) {
      if (!as_gradient || matrix.rows() > 0) {
        check_shape(matrix.rows(), matrix.cols(), rows, cols, d, what);
      }
    };
    check(match[d].map, source.values.size(), target.values.size(), "the functional map");
    check(match[d].soft_map, source.values.size(), target.values.size(),
          "the functional map of the soft map");
    check(match[d].pulled, source.functions.rows(), 3, "the pulled vertices");
    check(match[d].coarse, source.functions.rows(), 3, "the coarse vertices");
  }
}

// Phi^+ F, k x c, of each surface.
template <class Scalar>
std::array<RowMatrix<double>, 2> coefficients_of(const SurfacePair& surfaces,
                                                 const FeaturePair<Scalar>& features) {
  return {transposed_times(surfaces[0]->weighted, features[0].template cast<double>()),
          transposed_times(surfaces[1]->weighted, features[1].template cast<double>())};
}

template <class Scalar>
typename SoftMapPair<Scalar>::Both carried_by(const SurfacePair& surfaces) {
  return {surfaces[0]->carried.cast<Scalar>(), surfaces[1]->carried.cast<Scalar>()};
}

// Gradient with respect to what the soft map P of direction d pulled back, n_s x (k_t + 3), or of
// 0 rows where it is 0.
RowMatrix<double> grad_of_carried(const MatchSurface& source, const MatchSurface& target,
                                  const MatchDirection& gradient) {
  if (gradient.soft_map.rows() == 0 && gradient.pulled.rows() == 0 && gradient.coarse.rows() == 0) {
    return {};
  }
  const Eigen::Index k = target.values.size();
  RowMatrix<double> of_map = RowMatrix<double>::Zero(source.values.size(), k);
  if (gradient.soft_map.rows() > 0) {
    of_map += gradient.soft_map;
  }
  if (gradient.coarse.rows() > 0) {
    gemm(1.0, transposed_times(source.functions, gradient.coarse), Op::none, target.coordinates,
         Op::transpose, 1.0, of_map);
  }
  RowMatrix<double> carried = RowMatrix<double>::Zero(source.functions.rows(), k + 3);
  carried.leftCols(k) = product(source.weighted, of_map);
  if (gradient.pulled.rows() > 0) {
    carried.rightCols<3>() = gradient.pulled;
  }
  return carried;
}

}  // namespace

MatchSurface::MatchSurface(const SurfaceOperators& operators_in, const Eigenbasis& basis,
                           Eigen::Index count)
    : operators(&operators_in) {
  const Eigen::Index n = operators->vertices.rows();
  if (count < 1 || count > basis.size()) {
    throw Error(ErrorCode::bad_option,
                std::to_string(count) + " functions of a surface are asked for; there are " +
                    std::to_string(basis.size()) + ", and at least 1 is needed.");
  }
  if (basis.functions.rows() != n || basis.mass.size() != n) {
    throw Error(ErrorCode::wrong_shape, "A basis of " + std::to_string(basis.functions.rows()) +
                                            " vertices was given for a surface of " +
                                            std::to_string(n) + ".");
  }
  functions = basis.functions.leftCols(count);
  weighted = basis.mass.asDiagonal() * functions;
  values = basis.values.head(count);
  coordinates = transposed_times(weighted, operators->vertices);
  carried.resize(n, count + 3);
  carried << functions, operators->vertices;
  adjacency = face_adjacency(operators->faces, operators->corners);
}

namespace {

// What the soft maps compare.
template <class Scalar>
FeaturePair<Scalar> compared(const SurfacePair& surfaces, const FeaturePair<Scalar>& features,
                             const std::array<RowMatrix<double>, 2>& coefficients,
                             const UnsupervisedOptions& options) {
  if (!options.smooth_features) {
    return features;
  }
  FeaturePair<Scalar> result;
  for (size_t s = 0; s < 2; ++s) {
    result[s] = product(surfaces[s]->functions, coefficients[s]).template cast<Scalar>();
  }
  return result;
}

}  // namespace

template <class Scalar>
Match match(const SurfacePair& surfaces, const FeaturePair<Scalar>& features,
            const UnsupervisedOptions& options, ProgressRange progress) {
  check_features(surfaces, features);
  const std::array<RowMatrix<double>, 2> coefficients = coefficients_of(surfaces, features);
  Match result;
  for (size_t d = 0; d < 2; ++d) {
    result[d].map =
        feature_map(coefficients[d], coefficients[1 - d],
                    map_penalties(surfaces[d]->values, surfaces[1 - d]->values, options.map));
  }
  const FeaturePair<Scalar> seen = compared(surfaces, features, coefficients, options);
  const SoftMapPair<Scalar> soft(seen[0], seen[1], options.temperature,
                                 progress.stage("soft map", 0.0, 0.3));
  const auto pulled =
      soft.apply(carried_by<Scalar>(surfaces), progress.stage("soft map", 0.3, 1.0));
  for (size_t d = 0; d < 2; ++d) {
    const MatchSurface &source = *surfaces[d], &target = *surfaces[1 - d];
    MatchDirection& direction = result[d];
    direction.carried = pulled[d].values.template cast<double>();
    direction.sums = pulled[d].sums.template cast<double>();
    direction.soft_map =
        transposed_times(source.weighted, direction.carried.leftCols(target.values.size()));
    direction.pulled = direction.carried.rightCols<3>();
    direction.coarse = product(source.functions, product(direction.soft_map, target.coordinates));
  }
  return result;
}

template <class Scalar>
FeaturePair<Scalar> match_backward(const SurfacePair& surfaces, const FeaturePair<Scalar>& features,
                                   const Match& forward, const Match& gradient,
                                   const UnsupervisedOptions& options, ProgressRange progress) {
  check_features(surfaces, features);
  check_match(surfaces, gradient, true);
  const std::array<RowMatrix<double>, 2> coefficients = coefficients_of(surfaces, features);
  std::array<RowMatrix<double>, 2> of_coefficients;
  for (size_t s = 0; s < 2; ++s) {
    of_coefficients[s].setZero(coefficients[s].rows(), coefficients[s].cols());
  }
  FeaturePair<Scalar> of_carried;
  std::array<typename SoftMapPair<Scalar>::Pulled, 2> pulled;
  for (size_t d = 0; d < 2; ++d) {
    const MatchSurface &source = *surfaces[d], &target = *surfaces[1 - d];
    if (gradient[d].map.rows() > 0) {
      const FeatureMapGradient of_map =
          feature_map_backward(coefficients[d], coefficients[1 - d],
                               map_penalties(source.values, target.values, options.map),
                               forward[d].map, gradient[d].map);
      of_coefficients[d] += of_map.source;
      of_coefficients[1 - d] += of_map.target;
    }
    of_carried[d] = grad_of_carried(source, target, gradient[d]).template cast<Scalar>();
    pulled[d] = {forward[d].carried.template cast<Scalar>(),
                 forward[d].sums.template cast<Scalar>()};
  }
  const FeaturePair<Scalar> seen = compared(surfaces, features, coefficients, options);
  const SoftMapPair<Scalar> soft(seen[0], seen[1], options.temperature,
                                 progress.stage("derivative of the soft map", 0.0, 0.2));
  FeaturePair<Scalar> result =
      soft.backward(carried_by<Scalar>(surfaces), pulled, of_carried,
                    progress.stage("derivative of the soft map", 0.2, 1.0));
  for (size_t s = 0; s < 2; ++s) {
    if (options.smooth_features) {
      of_coefficients[s] +=
          transposed_times(surfaces[s]->functions, result[s].template cast<double>());
      result[s].setZero();
    }
    result[s] += product(surfaces[s]->weighted, of_coefficients[s]).template cast<Scalar>();
  }
  return result;
}

template Match match(const SurfacePair&, const FeaturePair<float>&, const UnsupervisedOptions&,
                     ProgressRange);
template Match match(const SurfacePair&, const FeaturePair<double>&, const UnsupervisedOptions&,
                     ProgressRange);
template FeaturePair<float> match_backward(const SurfacePair&, const FeaturePair<float>&,
                                           const Match&, const Match&, const UnsupervisedOptions&,
                                           ProgressRange);
template FeaturePair<double> match_backward(const SurfacePair&, const FeaturePair<double>&,
                                            const Match&, const Match&, const UnsupervisedOptions&,
                                            ProgressRange);

UnsupervisedLossValues unsupervised_loss(const SurfacePair& surfaces, const Match& match,
                                         const std::array<MatrixField, 2>& predicted,
                                         const UnsupervisedOptions& options,
                                         UnsupervisedLossGradient* gradient) {
  check_match(surfaces, match, false);
  if (gradient != nullptr) {
    *gradient = {};
    for (size_t d = 0; d < 2; ++d) {
      gradient->match[d].map.setZero(match[d].map.rows(), match[d].map.cols());
      gradient->match[d].soft_map.setZero(match[d].map.rows(), match[d].map.cols());
    }
  }
  UnsupervisedLossValues loss;
  for (size_t d = 0; d < 2; ++d) {
    const SurfaceOperators& source = *surfaces[d]->operators;
    RowMatrix<double>* grad = gradient != nullptr ? &gradient->match[d].map : nullptr;
    RowMatrix<double>* grad_soft = gradient != nullptr ? &gradient->match[d].soft_map : nullptr;
    RowMatrix<double>* grad_back = gradient != nullptr ? &gradient->match[1 - d].map : nullptr;
    loss.orthogonality += orthogonality_loss(match[d].map, options.orthogonality, grad);
    loss.coupling +=
        coupling_loss(match[d].map, match[d].soft_map, options.coupling, grad, grad_soft);
    loss.bijectivity +=
        bijectivity_loss(match[d].map, match[1 - d].map, options.bijectivity, grad, grad_back);
    if (predicted[d].rows() == 0) {
      continue;
    }
    JacobianLossGradient of_jacobians;
    const JacobianLossValues values = jacobian_loss(
        source, surfaces[d]->adjacency, options.jacobians, source.jacobians_of(match[d].pulled),
        predicted[d], gradient != nullptr ? &of_jacobians : nullptr);
    loss.fit += values.fit;
    loss.smoothness += values.smoothness;
    loss.determinant += values.determinant;
    loss.total += values.total;
    if (gradient != nullptr) {
      gradient->match[d].pulled = jacobians_backward(source.inverse_frames, match[d].pulled,
                                                     source.faces, of_jacobians.rough);
      gradient->predicted[d] = std::move(of_jacobians.predicted);
    }
  }
  loss.total += options.orthogonality * loss.orthogonality + options.coupling * loss.coupling +
                options.bijectivity * loss.bijectivity;
  return loss;
}

}  // namespace supple
