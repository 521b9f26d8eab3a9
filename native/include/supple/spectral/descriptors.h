// SPDX-License-Identifier: GPL-3.0-or-later
// Functions on a surface that a near-isometric copy has as well, from its eigenfunctions. All take
// the surface in units where its area is 1, so that a scaled copy has the same.
#pragma once

#include "supple/core/types.h"
#include "supple/spectral/eigenbasis.h"

namespace supple {

/// n x times: sum_i exp(-t lambda_i) phi_i(x)^2. times: in units of area.
/// Source: Sun, Ovsjanikov and Guibas 2009.
RowMatrix<double> heat_kernel_signature(const Eigenbasis& basis, const Eigen::VectorXd& times);

/// n x energies: sum_i w_i phi_i(x)^2 / sum_i w_i, w_i = exp(-(e - log lambda_i)^2 / 2 sigma^2),
/// over the functions that are not constant. energies: logarithms of eigenvalues; sigma > 0.
/// Source: Aubry, Schlickewei and Cremers 2011.
RowMatrix<double> wave_kernel_signature(const Eigenbasis& basis, const Eigen::VectorXd& energies,
                                        double sigma);

/// n x times: the heat at x a time after a unit of it was at a vertex,
/// sum_i exp(-t lambda_i) phi_i(vertex) phi_i(x).
RowMatrix<double> heat_kernel(const Eigenbasis& basis, int vertex, const Eigen::VectorXd& times);

/// n x energies: the band-pass kernel sum_i w_i phi_i(vertex) phi_i(x) / sum_i w_i, weights as in
/// `wave_kernel_signature`.
RowMatrix<double> wave_kernel(const Eigenbasis& basis, int vertex, const Eigen::VectorXd& energies,
                              double sigma);

/// Energies, ascending, evenly spaced over the eigenvalues above 0 that both surfaces have, and the
/// sigma of their spacing (seven times it, as Aubry et al. have it).
struct WaveEnergies {
  Eigen::VectorXd energies;
  double sigma = 1.0;
};
WaveEnergies wave_energies(const Eigenbasis& a, const Eigenbasis& b, int count);

}  // namespace supple
