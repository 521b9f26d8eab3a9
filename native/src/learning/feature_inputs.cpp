// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/feature_inputs.h"

#include <algorithm>
#include <cmath>

#include "supple/core/error.h"
#include "supple/spectral/descriptors.h"

namespace supple {
namespace {

RowMatrix<double> heat_inputs(const Eigenbasis& basis, const WaveEnergies& range, int count) {
  // The energies' ends are the logarithms of the least eigenvalue above 0 and of the largest.
  const double scale = std::log(4.0 * std::log(10.0));
  const Eigen::VectorXd times = Eigen::VectorXd::LinSpaced(count, scale - range.energies[count - 1],
                                                           scale - range.energies[0])
                                    .array()
                                    .exp();
  const RowMatrix<double> heat = heat_kernel_signature(basis, times);
  const Eigen::RowVectorXd mean = basis.mass.transpose() * heat / basis.mass.sum();
  return heat * mean.cwiseInverse().asDiagonal();
}

}  // namespace

const char* to_string(FeatureInput kind) {
  switch (kind) {
    case FeatureInput::wave_kernel:
      return "wave_kernel";
    case FeatureInput::heat_kernel:
      return "heat_kernel";
    case FeatureInput::coordinates:
      return "coordinates";
  }
  return "";
}

FeatureInput feature_input(const std::string& name) {
  for (const FeatureInput kind :
       {FeatureInput::wave_kernel, FeatureInput::heat_kernel, FeatureInput::coordinates}) {
    if (name == to_string(kind)) {
      return kind;
    }
  }
  throw Error(
      ErrorCode::bad_option,
      "'" + name + "' is no input of features. Use 'wave_kernel', 'heat_kernel' or 'coordinates'.");
}

RowMatrix<double> feature_inputs(FeatureInput kind, const SurfaceOperators& operators,
                                 const Eigenbasis& basis, int count) {
  const bool coordinates = kind == FeatureInput::coordinates;
  const int least = coordinates ? 3 : kind == FeatureInput::heat_kernel ? 2 : 1;
  if (count < least || (coordinates && count > 3)) {
    throw Error(ErrorCode::bad_option, std::string("There are no ") + std::to_string(count) +
                                           " inputs of the kind '" + to_string(kind) + "'. Use " +
                                           std::to_string(least) +
                                           (coordinates ? "." : " or more."));
  }
  if (coordinates) {
    return operators.vertices;
  }
  if (basis.size() <= operators.component_count) {
    throw Error(
        ErrorCode::bad_option,
        "The inputs '" + std::string(to_string(kind)) + "' need more eigenfunctions than the " +
            std::to_string(operators.component_count) +
            " constants of the surface's components; the basis has " +
            std::to_string(basis.size()) + ". Merge vertices at the same place, or ask for more.");
  }
  const WaveEnergies range = wave_energies(basis, basis, count);
  return kind == FeatureInput::wave_kernel
             ? wave_kernel_signature(basis, range.energies, range.sigma)
             : heat_inputs(basis, range, count);
}

}  // namespace supple
