// SPDX-License-Identifier: GPL-3.0-or-later
// Maps between two surfaces, "source" and "target": as one target vertex for each source vertex (a
// point map), and as a matrix between their eigenfunctions (a functional map).
#pragma once

#include "supple/core/progress.h"
#include "supple/core/types.h"
#include "supple/spectral/eigenbasis.h"

namespace supple {

// Of an `Eigenbasis`, `functions` and `mass` are read. Functions are taken in units where their
// surface has area 1, so that a scaled copy of a surface has the functional map 1.

/// C, source_count x target_count: the coefficients on the source of each target function pulled
/// back, C = Phi_s^T M_s Phi_t[point_map]; the mass-weighted projection is the pseudo-inverse of
/// functions that are M-orthonormal. point_map: one target vertex for each source vertex.
/// Source: Ovsjanikov et al. 2012; the paper's C_21 = Psi_1^+ Pi_12 Psi_2, source 1, target 2.
/// Errors: `wrong_shape`, `index_out_of_range`; `bad_option` for counts outside [1, functions].
RowMatrix<double> functional_map(const Eigenbasis& source, const Eigenbasis& target,
                                 const Eigen::VectorXi& point_map, Eigen::Index source_count,
                                 Eigen::Index target_count);

/// The target vertex of each source vertex: for row i of Phi_s, the nearest row of Phi_t C^T.
/// map: C, k_s x k_t, of the first k_s and k_t functions.
/// Source: the paper, the Eqn after C_21, in the form of Melzi et al. 2019, Eqn 3.
/// Errors: those of `nearest_rows`; `bad_option` for a map of more functions than there are.
Eigen::VectorXi point_map(const Eigenbasis& source, const Eigenbasis& target,
                          const RowMatrix<double>& map, ProgressRange progress = {});

struct ZoomoutOptions {
  int from = 20;  ///< functions in the first round, >= 1
  int to = 120;   ///< and in the last, >= from
  int step = 5;   ///< more in each round, >= 1; the last round may get fewer
  /// Source vertices, spread evenly over the surface: only they are mapped between the rounds, and
  /// every vertex at the end. More of them than `to`; empty: every vertex in every round.
  Eigen::VectorXi samples{};
};

struct Zoomout {
  Eigen::VectorXi point_map;         ///< ns, from `functional_map`
  RowMatrix<double> functional_map;  ///< to x to
};

/// Refines a point map: each round makes a functional map of it, and a point map of that, with more
/// functions than the round before. The defaults are the paper's.
/// initial: one target vertex for each source vertex.
/// Source: Melzi et al. 2019, "ZoomOut: Spectral Upsampling for Efficient Shape Correspondence",
/// and its "Acceleration" for the samples (of the source only: images stay as fine as the target).
/// Errors: those of the two; `bad_option`; `index_out_of_range` for a sample; `cancelled`.
Zoomout zoomout(const Eigenbasis& source, const Eigenbasis& target, const Eigen::VectorXi& initial,
                const ZoomoutOptions& options = {}, ProgressRange progress = {});

}  // namespace supple
