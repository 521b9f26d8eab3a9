// SPDX-License-Identifier: GPL-3.0-or-later
// The volume that an edit encloses. n vertices, surface units.
#pragma once

#include <vector>

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

  /// Moves the vertices along `way` (n x 3) until each component has got back most of the volume it
  /// has lost. way: as smooth as the Poisson equation allows, a solution of it with the gradient of
  /// about this shape; 0 at held vertices.
  /// kept: a component, its volume before the edit; those with 0 stay as they are.
  void restore(const Eigen::VectorXd& kept, const Points& way, Points& moved) const;

 private:
  /// What a component encloses at moved + t way: c[0] + c[1] t + c[2] t^2 + c[3] t^3.
  struct Cubic {
    double c[4] = {};
  };
  std::vector<Cubic> along(const Points& moved, const Points& way) const;

  const SurfaceOperators& operators_;
  Eigen::VectorXd at_rest_;
};

}  // namespace supple
