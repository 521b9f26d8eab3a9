// SPDX-License-Identifier: GPL-3.0-or-later
// Learning maps and deformations of two surfaces together, without a known map: what features say
// of the pair, what it costs, and the way back to the features. Source: the paper, Eqns 12-14.
//
//   features --match--> maps, pulled and coarse vertices --networks--> Jacobians
//       |                              |                                   |
//   match_backward <---------- unsupervised_loss <-------------------------+
//
// Direction d of a pair has surface d for its source and the other for its target. n_d vertices,
// m_d faces, k_d eigenfunctions.
#pragma once

#include <array>

#include "supple/core/progress.h"
#include "supple/core/types.h"
#include "supple/geometry/surface_operators.h"
#include "supple/learning/feature_map.h"
#include "supple/learning/jacobian_loss.h"
#include "supple/spectral/eigenbasis.h"

namespace supple {

/// What the losses need to know of one surface, built once.
struct MatchSurface {
  /// The basis is that of the operators' surface; its first `count` functions are used.
  /// Errors: `bad_option` for a count outside [1, functions]; `wrong_shape`.
  MatchSurface(const SurfaceOperators& operators, const Eigenbasis& basis, Eigen::Index count);

  const SurfaceOperators* operators;  ///< not owned; must outlive this
  RowMatrix<double> functions;        ///< n x k, Phi
  RowMatrix<double> weighted;         ///< n x k, M Phi: Phi^+ is its transpose
  Eigen::VectorXd values;             ///< k
  RowMatrix<double> coordinates;      ///< k x 3, Phi^+ V
  RowMatrix<double> carried;          ///< n x (k + 3), Phi and V: what a soft map pulls back
  SparseRowMatrix adjacency;          ///< m x m, `face_adjacency`
};
using SurfacePair = std::array<const MatchSurface*, 2>;

struct UnsupervisedOptions {
  double temperature = 0.07;  ///< of the soft maps, > 0
  /// Soft maps compare features projected to the surface's functions instead of the features as
  /// they are, as Sun et al. 2023 do ("Spatially and Spectrally Consistent Deep Functional Maps").
  bool smooth_features = false;
  FeatureMapOptions map;
  /// Weights of the terms; the defaults are the paper's. ULRSSM (Cao et al. 2023) is bijectivity 1
  /// and all of `jacobians` 0; CDFM (Sun et al. 2023) that with smooth features, 50 functions and a
  /// temperature that falls from 1 to 1 / 50 (and distances where cosines are compared here).
  double orthogonality = 1.0;
  double coupling = 1.0;
  double bijectivity = 0.0;
  JacobianWeights jacobians;
};

/// One direction. As a gradient, the same fields hold derivatives; empty ones are 0.
struct MatchDirection {
  RowMatrix<double> map;       ///< C, k_s x k_t, `feature_map` of the features
  RowMatrix<double> soft_map;  ///< C', k_s x k_t, Phi_s^+ P Phi_t of their soft map P. Eqn 12
  Points pulled;               ///< n_s x 3, P V_t
  Points coarse;               ///< n_s x 3, Phi_s C' Phi_t^+ V_t: the networks' signal. Eqn 10
  /// What `match_backward` asks for besides; of no use in a gradient.
  RowMatrix<double> carried{};  ///< n_s x (k_t + 3), P of what the target carries
  Eigen::VectorXd sums{};       ///< n_s: what the rows of P were divided by
};
using Match = std::array<MatchDirection, 2>;
/// n_d x c features of each surface, float or double: what the soft maps are computed in. The
/// functional maps, and all that is returned but gradients, are double.
template <class Scalar>
using FeaturePair = std::array<RowMatrix<Scalar>, 2>;

/// What the features say of the pair, in surface units.
/// Errors: those of `SoftMapPair`, `map_penalties` and `feature_map`; `wrong_shape`; `cancelled`.
template <class Scalar>
Match match(const SurfacePair& surfaces, const FeaturePair<Scalar>& features,
            const UnsupervisedOptions& options = {}, ProgressRange progress = {});

/// Gradients with respect to both surfaces' features from those with respect to what `match`
/// returned for the same arguments, `forward`. Errors: those of `match`.
template <class Scalar>
FeaturePair<Scalar> match_backward(const SurfacePair& surfaces, const FeaturePair<Scalar>& features,
                                   const Match& forward, const Match& gradient,
                                   const UnsupervisedOptions& options = {},
                                   ProgressRange progress = {});

/// The terms before weighting, both directions together, and their weighted sum.
struct UnsupervisedLossValues {
  double orthogonality = 0.0, coupling = 0.0, bijectivity = 0.0;
  double fit = 0.0, smoothness = 0.0, determinant = 0.0;
  double total = 0.0;
};

struct UnsupervisedLossGradient {
  Match match;  ///< `coarse` is empty: add to it what comes back through the networks' signals
  std::array<MatrixField, 2> predicted;  ///< m_d x 9, with respect to the networks' Jacobians
};

/// The paper's unsupervised loss (Eqn 13), summed over both directions:
///   |C^T C - I|^2 + |C - C'|^2 + L_J, with `jacobian_loss` L_J against the Jacobians to `pulled`.
/// predicted: m_d x 9 each, what the networks make of `coarse`; empty ones leave out L_J.
/// Where the pulled vertices shrink a face to a point, the derivative of its normal is not bounded;
/// to train features without it, set the gradient's `pulled` to 0 rows.
/// Errors: `wrong_shape`; `not_finite` for Jacobians.
UnsupervisedLossValues unsupervised_loss(const SurfacePair& surfaces, const Match& match,
                                         const std::array<MatrixField, 2>& predicted,
                                         const UnsupervisedOptions& options = {},
                                         UnsupervisedLossGradient* gradient = nullptr);

}  // namespace supple
