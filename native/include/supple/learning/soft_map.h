// SPDX-License-Identifier: GPL-3.0-or-later
// Soft maps between two surfaces from features at their vertices, with derivatives.
#pragma once

#include <array>
#include <vector>

#include "supple/core/progress.h"
#include "supple/core/types.h"

namespace supple {

/// The soft maps between two surfaces, both directions, from features F_0 (n_0 x c) and F_1
/// (n_1 x c), of which every row is divided by its length:
///   P_0 = softmax of F_0 F_1^T / temperature along each row, n_0 x n_1,
///   P_1 = softmax of F_1 F_0^T / temperature along each row, n_1 x n_0:
/// direction d has surface d for its source and the other for its target; for each source vertex,
/// weights of all target vertices, sum 1. float or double.
///
/// Nothing of n_0 x n_1 is stored. Tiles of the products are computed, used for both directions and
/// forgotten: a call takes three tiles (2^18 numbers each) a thread and, a thread, sums of the size
/// of what it returns for surface 1, besides the features and what it is given once more. Threads
/// share the rows of surface 0, each with a BLAS of its own. The same bytes for the same number of
/// threads.
///
/// Rows of length 1 have products of at most 1, so one exp((F_0 F_1^T - 1) / temperature) serves
/// both directions as long as none of it vanishes: down to a temperature of 1/30 for float, 1/300
/// for double. Below it, every row and every column has its largest product taken off first, which
/// takes the products once more and two exponentials.
///
/// float: products are good to about 1e-7 and weights to that part of the temperature, about 2e-6
/// at 0.07. The gradient of a row f is good to 2e-6 |G| |X| / (temperature |f|), G a row of
/// gradients and X one of values: where weights are as good as hard and derivatives all but vanish,
/// little more than this error is left of them.
/// Source: the paper, Eqn 12; rows of length 1 as in Cao et al. 2023 (ULRSSM).
template <class Scalar>
class SoftMapPair {
 public:
  /// Of surfaces 0 and 1.
  using Both = std::array<RowMatrix<Scalar>, 2>;
  using Vector = Eigen::Matrix<Scalar, Eigen::Dynamic, 1>;

  /// temperature > 0. Errors: `wrong_shape`; `not_finite`, also for a row of zeros; `bad_option`;
  /// `cancelled`.
  SoftMapPair(const RowMatrix<Scalar>& first, const RowMatrix<Scalar>& second,
              double temperature = 0.07, ProgressRange progress = {});

  /// What a direction d pulled back.
  struct Pulled {
    RowMatrix<Scalar> values;  ///< n_d x k, P_d X
    Vector sums;               ///< n_d: what its rows were divided by; `backward` asks for it
  };
  /// P_0 X_1 and P_1 X_0 of values X_d, n_d x k_d. Values of 0 rows leave out the direction that
  /// would pull them back; what it pulled is empty. Errors: `wrong_shape`, also for no values at
  /// all; `cancelled`.
  std::array<Pulled, 2> apply(const Both& values, ProgressRange progress = {}) const;

  /// Gradients with respect to both features as they were given, before the division, from those
  /// with respect to what `apply` pulled for the same values, n_d x k_(1-d). A gradient of 0 rows
  /// is 0. Errors: `wrong_shape`; `cancelled`.
  Both backward(const Both& values, const std::array<Pulled, 2>& pulled, const Both& grad,
                ProgressRange progress = {}) const;

  /// n_d: the target vertex of the largest weight. Ties to the lowest index. direction: 0 or 1.
  /// Errors: those of `nearest_rows`.
  Eigen::VectorXi hard_map(size_t direction, ProgressRange progress = {}) const;

  Eigen::Index rows(size_t surface) const { return lengths_[surface].size(); }

 private:
  // Some neighbouring rows each.
  using Tiles = std::vector<RowMatrix<Scalar>>;
  struct Tile;

  template <class Step>
  void over_tiles(const ProgressRange& progress, const Step& step) const;
  void find_largest(const ProgressRange& progress);
  void weigh(Tile& tile, size_t direction) const;
  size_t parts() const;

  Scalar temperature_;
  bool one_weight_;                         // one exponential serves both directions
  std::array<Tiles, 2> features_;           // rows of length 1
  std::array<Eigen::VectorXd, 2> lengths_;  // what they were divided by
  std::array<Tiles, 2> largest_;  // n_d x 1: largest product of each row, of each column; or empty
};

}  // namespace supple
