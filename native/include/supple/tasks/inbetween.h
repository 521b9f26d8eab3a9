// SPDX-License-Identifier: GPL-3.0-or-later
// In-betweening: a few poses of a mesh in, every pose between them out.
#pragma once

#include <memory>
#include <vector>

#include "supple/core/progress.h"
#include "supple/tasks/prepared_mesh.h"

namespace supple {

struct InbetweenOptions {
  /// Whether the motion goes through inner keys without a change of speed (C1): Catmull-Rom
  /// tangents for unequal times, natural ends. Otherwise each pair of keys is interpolated by
  /// itself. Two keys are the same either way, at uniform speed.
  bool smooth = true;
};

/// Key poses of a mesh at given times, interpolated. Each face's Jacobian is parted into rotation
/// and stretch (J = W Q); rotations are interpolated on SO(3), stretches linearly, or both by
/// cubics, and one Poisson solve a frame joins the faces again. So parts turn on arcs, where a
/// blend of positions would cut across and shrink them. Immutable; safe to use from several
/// threads.
///
/// A step from key to key turns a face by less than half a turn or by more, whichever agrees with
/// its neighbours; a connected piece as a whole takes the shorter way. Faces that turn by a whole
/// turn and more have no axis of their own there: give such a step a key in between.
///
/// What the Jacobians leave open is where a piece is. Its vertices' positions are interpolated as
/// well, and it lies nearest to them, weighted by mass over variance over the keys: what stands
/// still in all keys, a planted foot, stays. A piece or a vertex without faces that moves with the
/// largest piece, as eyes do with a head, is interpolated relative to the nearest point of that.
///
/// Source: Xu, Zhang, Wang and Bao 2005, "Poisson shape interpolation", here with rotations that
/// agree across faces and several keys.
class Inbetween {
 public:
  /// poses: at least 2, n x 3 each, the vertices of the prepared mesh in the caller's units. times:
  /// one a pose, ascending. The rest mesh need not be one of the poses.
  /// Errors: `wrong_shape`, `not_finite`; `bad_option` for times that do not ascend; `cancelled`.
  Inbetween(std::shared_ptr<const PreparedMesh> prepared, std::vector<Points> poses,
            std::vector<double> times, const InbetweenOptions& options = {},
            ProgressRange progress = {});
  ~Inbetween();
  Inbetween(Inbetween&&) noexcept;

  /// n x 3, in the caller's units: at a key its pose bit for bit; before the first and after the
  /// last the pose there. Errors: `not_finite`.
  Points at(double time) const;

 private:
  struct Impl;
  std::unique_ptr<const Impl> impl_;
};

}  // namespace supple
