// SPDX-License-Identifier: GPL-3.0-or-later
// The volume that an edit encloses. n vertices, surface units.
#pragma once

#include "supple/geometry/held_system.h"
#include "supple/geometry/surface_operators.h"

namespace supple {

/// Volumes inside the components of a surface that are closed: every edge has two faces, turned
/// the same way. Immutable.
class EnclosedVolume {
 public:
  /// operators: kept, not owned.
  explicit EnclosedVolume(const SurfaceOperators& operators);

  /// A component: its volume at rest; 0 where it is open, encloses next to nothing or is inside
  /// out.
  const Eigen::VectorXd& at_rest() const { return at_rest_; }
  /// A component: its volume with moved vertices (n x 3), from their gradient.
  Eigen::VectorXd of(const Points& moved, const Points& gradient) const;
  /// n x 3: gradient of the vertex's own component's volume.
  Points gradient(const Points& moved) const;

  /// A component: the volumes that a pose (n x 3) encloses; 0 where `at_rest` is 0, and where it
  /// encloses next to nothing.
  Eigen::VectorXd in(const Points& pose) const;

  /// Moves the vertices that are not held, as smoothly as the Poisson equation allows, until each
  /// component has got back most of the volume it has lost.
  /// kept: a component, its volume before the edit; those with 0 stay as they are.
  void restore(const HeldSystem& poisson, const Eigen::VectorXd& kept, Points& moved) const;

 private:
  const SurfaceOperators& operators_;
  Eigen::VectorXd at_rest_;
};

}  // namespace supple
