// SPDX-License-Identifier: GPL-3.0-or-later
// Functional maps solved for from features, with derivatives.
#pragma once

#include <string>

#include "supple/core/types.h"

namespace supple {

/// What keeps the entry between two eigenfunctions small: the difference of their eigenvalues ...
enum class MapPenalty {
  /// ... seen through the Laplacian's resolvent, |1 / (l_s^g - i) - 1 / (l_t^g - i)|^2. Ren et al.
  /// 2019, "Structured Regularization of Functional Map Computations".
  resolvent,
  /// ... itself, (l_s - l_t)^2. Donati et al. 2020, "Deep Geometric Functional Maps".
  commutator,
};
const char* to_string(MapPenalty penalty);
/// Errors: `bad_option` for any other name.
MapPenalty map_penalty(const std::string& name);

/// The defaults are those of Cao et al. 2023 (ULRSSM), whose maps the paper uses.
struct FeatureMapOptions {
  MapPenalty penalty = MapPenalty::resolvent;
  double weight = 100.0;  ///< >= 0
  double exponent = 0.5;  ///< g of the resolvent, > 0
};

/// k_s x k_t, >= 0: what the square of each entry of a map costs, the weight with it. Eigenvalues
/// (k_s and k_t, >= 0) are taken as parts of the largest of both.
/// Errors: `wrong_shape` for none; `not_finite`; `bad_option`.
RowMatrix<double> map_penalties(const Eigen::VectorXd& source_values,
                                const Eigen::VectorXd& target_values,
                                const FeatureMapOptions& options = {});

/// C, k_s x k_t, from the target to the source: the least
///   |C A_t - A_s|^2 + sum_ij D_ij C_ij^2
/// of features' coefficients A_s (k_s x c) and A_t (k_t x c), D `map_penalties`. One system a row,
/// (A_t A_t^T + diag D_i) c_i = A_t (A_s)_i.
/// Errors: `wrong_shape`; `not_finite`; `not_positive_definite` where features and penalties leave
/// a row open.
RowMatrix<double> feature_map(const RowMatrix<double>& source, const RowMatrix<double>& target,
                              const RowMatrix<double>& penalties);

struct FeatureMapGradient {
  RowMatrix<double> source;  ///< k_s x c, with respect to A_s
  RowMatrix<double> target;  ///< k_t x c
};
/// From the gradient with respect to `map`, which `feature_map` returned for the same arguments.
/// Errors: those of `feature_map`.
FeatureMapGradient feature_map_backward(const RowMatrix<double>& source,
                                        const RowMatrix<double>& target,
                                        const RowMatrix<double>& penalties,
                                        const RowMatrix<double>& map,
                                        const RowMatrix<double>& grad);

}  // namespace supple
