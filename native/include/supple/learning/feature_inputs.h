// SPDX-License-Identifier: GPL-3.0-or-later
// What a network that learns features of a surface is given at each vertex.
#pragma once

#include <string>

#include "supple/core/types.h"
#include "supple/geometry/surface_operators.h"
#include "supple/spectral/eigenbasis.h"

namespace supple {

enum class FeatureInput {
  /// Wave kernel signatures at `count` energies, `wave_energies` of the surface itself. Intrinsic;
  /// a
  /// channel's mean over the surface is 1.
  wave_kernel,
  /// Heat kernel signatures at `count` times from 4 log 10 / lambda_k to 4 log 10 / lambda_1 by
  /// equal factors, each over its mean over the surface, as Sun, Ovsjanikov and Guibas 2009 have
  /// it. Intrinsic.
  heat_kernel,
  /// Three coordinates, area 1 and centroid 0: turns with the surface. `count` is 3.
  coordinates,
};
const char* to_string(FeatureInput kind);
/// Errors: `bad_option` for any other name.
FeatureInput feature_input(const std::string& name);

/// n x count. Errors: `bad_option` for a count the kind does not have (below 2 for `heat_kernel`,
/// below 1, other than 3 for `coordinates`), or a basis of constants only.
RowMatrix<double> feature_inputs(FeatureInput kind, const SurfaceOperators& operators,
                                 const Eigenbasis& basis, int count);

}  // namespace supple
