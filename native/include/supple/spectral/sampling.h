// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "supple/core/types.h"
#include "supple/spectral/eigenbasis.h"

namespace supple {

/// `count` vertex indices, ascending, spread over n x 3 points by farthest-point sampling; all n
/// where n <= count. Distances equal to 1e-9 are ties and go to the lowest index, so that rounding
/// (a turned mesh) does not change the choice.
Eigen::VectorXi farthest_point_samples(const Points& points, Eigen::Index count);

/// Where a network is evaluated, and how its features get to and from the eigenfunctions.
template <class Scalar>
struct SpectralDomain {
  RowMatrix<Scalar> functions;  ///< p x k: the eigenfunctions at the evaluation points
  RowMatrix<Scalar> projector;  ///< k x p: coefficients of a field known at those points
};

/// Every vertex: projector = Phi^T M. Exact.
template <class Scalar>
SpectralDomain<Scalar> full_domain(const Eigenbasis& basis, Eigen::Index count);

/// The given p vertices: projector = (Phi_s^T A Phi_s)^-1 Phi_s^T A with A the mass nearest to each
/// sample. Exact on the span of the functions; needs p well above `count`.
template <class Scalar>
SpectralDomain<Scalar> sampled_domain(const Eigenbasis& basis, Eigen::Index count,
                                      const Points& points, const Eigen::VectorXi& samples);

}  // namespace supple
