// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <deque>

#include "energies.h"
#include "supple/geometry/held_system.h"

namespace supple {

/// Descends an energy of the moved vertices while the held ones stay: L-BFGS whose first guess of
/// the inverse second derivative is the Laplacian's, with the handles held. For ARAP a step without
/// memory is the local-global step; the memory is what accelerates it. One Poisson solve a pass.
/// Source: Liu, Bouaziz and Kavan 2017.
class Descent {
 public:
  /// All three are kept, not owned.
  Descent(const DeformationEnergy& energy, const HeldSystem& poisson)
      : energy_(energy), poisson_(poisson) {}

  /// One pass on `moved`, whose held rows stay as they are. `energy` changed meanwhile: `forget`.
  void pass(Points& moved);
  void forget();
  /// Whether the last pass changed the energy by less than 1e-7 of it.
  bool converged() const { return converged_; }

 private:
  static constexpr size_t kMemory = 8;
  struct Pair {
    Points step, change, solved;  // s, y, Laplacian^-1 y
    double product;               // s . y
  };

  const DeformationEnergy& energy_;
  const HeldSystem& poisson_;
  std::deque<Pair> memory_;
  bool started_ = false, converged_ = false;
  double value_ = 0.0;
  Points gradient_, solved_;
};

}  // namespace supple
