// SPDX-License-Identifier: GPL-3.0-or-later
// Functional maps from functions that correspond, and their upsampling on few points.
#pragma once

#include <utility>
#include <vector>

#include "supple/core/progress.h"
#include "supple/core/types.h"
#include "supple/spectral/eigenbasis.h"

namespace supple {

/// What a functional map C (k_s x k_t, as in functional_map.h) is asked to respect.
struct MapConstraints {
  RowMatrix<double> source;  ///< k_s x d: coefficients of d functions on the source
  RowMatrix<double> target;  ///< k_t x d: of the same functions on the target; C target ~ source
  /// Operators on coefficients, k_s x k_s and k_t x k_t, with C target = source C.
  std::vector<std::pair<RowMatrix<double>, RowMatrix<double>>> operators;
  double commuting = 1.0;  ///< weight of C Lambda_t = Lambda_s C, values over the largest
  double operator_weight = 1.0;
};

/// The C that minimises the squares of all residuals: d descriptors as one mean square, likewise
/// each operator, whose norms are made 1. values: the first k_s and k_t eigenvalues, area 1.
/// With operators one dense system of k_s k_t unknowns, else k_s of k_t.
/// Source: Ovsjanikov et al. 2012 and, for the operators, Ren et al. 2018.
RowMatrix<double> fit_functional_map(const Eigen::VectorXd& source_values,
                                     const Eigen::VectorXd& target_values,
                                     const MapConstraints& constraints);

/// k x k: the operator h -> n . (grad f x grad h) between the first k functions, by which a
/// function f and the surface's orientation turn gradients: maps that keep the orientation commute
/// with it, mirrored ones change its sign. field: n, f at the vertices.
/// Source: Ren et al. 2018, "Continuous and orientation-preserving correspondences via functional
/// maps", section 4.
RowMatrix<double> orientation_operator(const Eigenbasis& basis, const Faces& faces,
                                       const Eigen::VectorXd& field, Eigen::Index count);

/// Rows of eigenfunctions at some vertices of a surface of area 1, and the masses there.
struct SampledFunctions {
  RowMatrix<double> functions;  ///< p x k
  Eigen::VectorXd weights;      ///< p, > 0
};
SampledFunctions sampled_functions(const Eigenbasis& basis, const Eigen::VectorXi& vertices,
                                   Eigen::Index count);

/// For row i of the first k_s columns of `source`, the nearest row of scale T C^T, T the first k_t
/// columns of `target`; C: k_s x k_t. Errors: those of `nearest_rows`.
Eigen::VectorXi nearest_images(const RowMatrix<double>& source, const RowMatrix<double>& target,
                               const RowMatrix<double>& map, double scale,
                               ProgressRange progress = {});

/// p: the row of the target that is nearest to each row of the source under C (k_s x k_t).
Eigen::VectorXi sampled_point_map(const SampledFunctions& source, const SampledFunctions& target,
                                  const RowMatrix<double>& map);

/// The C of the first `count` functions, by least squares over the source's rows. map: p, a row of
/// the target each.
RowMatrix<double> sampled_functional_map(const SampledFunctions& source,
                                         const SampledFunctions& target, const Eigen::VectorXi& map,
                                         Eigen::Index count);

/// ZoomOut on the samples: from C to one of `to` functions, `step` more a round.
/// Source: Melzi et al. 2019, section 4.5.
/// fixed: source and target rows that correspond; they stay so in every round.
/// Errors: `cancelled`.
RowMatrix<double> sampled_zoomout(const SampledFunctions& source, const SampledFunctions& target,
                                  RowMatrix<double> map, Eigen::Index to, Eigen::Index step,
                                  const std::vector<std::pair<int, int>>& fixed = {},
                                  const ProgressRange& progress = {});

}  // namespace supple
