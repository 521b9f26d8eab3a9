// SPDX-License-Identifier: GPL-3.0-or-later
// Features and deformation of a pair of surfaces in one loss, with its gradient for both networks.
// Source: the paper, section 4.4, Eqns 12-14.
//
//   surfaces --features--> match --signal--> local Jacobian network --> unsupervised_loss
#pragma once

#include <array>
#include <memory>
#include <optional>

#include "supple/core/progress.h"
#include "supple/core/types.h"
#include "supple/learning/feature_network.h"
#include "supple/learning/network.h"
#include "supple/learning/unsupervised_loss.h"

namespace supple {

/// The two networks that are trained together; without the second one the loss has no L_J.
template <class Scalar>
struct JointNetworks {
  FeatureNetwork<Scalar> features;
  std::optional<LocalJacobianNetwork<Scalar>> jacobians;  ///< of the signal `spectral`
};

/// What a loss needs to know of one surface, built once. Not copied by value: it is large.
template <class Scalar>
struct JointSurface {
  /// functions: of the functional maps and the signal, in [1, functions of the basis]; fewer where
  /// that would cut through a multiple eigenvalue. network: what the local Jacobian network needs
  /// of this surface; nullptr without one. The surface must outlive this.
  /// Errors: those of `MatchSurface` and `FeatureContext`.
  JointSurface(const SurfaceOperators& operators, const Eigenbasis& basis,
               const FeatureArchitecture& architecture, int functions,
               std::shared_ptr<const NetworkContext<Scalar>> network);

  FeatureContext<Scalar> features;
  MatchSurface match;
  Points coarse;  ///< n x 3, the surface's own vertices in its functions
  std::shared_ptr<const NetworkContext<Scalar>> network;
};
template <class Scalar>
using JointPair = std::array<const JointSurface<Scalar>*, 2>;

/// A known, rough functional map of each direction (k_s x k_t) that soft maps are drawn to; weight
/// 0 for none: adds weight |C'_d - maps[d]|^2.
struct Guide {
  double weight = 0.0;
  std::array<RowMatrix<double>, 2> maps;
};

struct JointLossValues {
  UnsupervisedLossValues terms;
  double guide = 0.0;  ///< before weighting
  double total() const { return terms.total; }
};

template <class Scalar>
struct JointGradient {
  DiffusionParameters<Scalar> features;
  LayerParameters<Scalar> jacobians;  ///< empty without a second network
};

/// The loss of a pair and, if asked for, its gradient (replaced, not added to). Same threads: same
/// bytes. Errors: those of `match` and `unsupervised_loss`; `wrong_shape` for a guide of other
/// shapes; `bad_option` for a surface without a network's context; `cancelled`.
template <class Scalar>
JointLossValues joint_loss(const JointNetworks<Scalar>& networks, const JointPair<Scalar>& pair,
                           const UnsupervisedOptions& options, const Guide& guide,
                           JointGradient<Scalar>* gradient = nullptr, ProgressRange progress = {});

}  // namespace supple
