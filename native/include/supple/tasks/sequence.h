// SPDX-License-Identifier: GPL-3.0-or-later
// Editing an animation: corrections that travel with the moving surface, each frame by itself.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "supple/core/progress.h"
#include "supple/tasks/edit.h"

namespace supple {

/// Where the surface at a handle is in a pose: the rigid motion (4 x 4, for column vectors,
/// caller's units) that takes the centre of the handle's vertices at rest to their centre in the
/// pose, and turns as the faces around them do: the closest rotation of the mean, by rest area, of
/// their Jacobians. A correction C of the rest shape is `frame C frame^-1` there. Errors:
/// `index_out_of_range`; `empty_handle`.
Eigen::Matrix4d handle_frame(const PreparedMesh& prepared, const Eigen::VectorXi& vertices,
                             const StartPose& pose);

/// Part of a motion: at 0 none of it, at 1 all. The rotation's angle, the stretch's difference from
/// 1 and the way of the point `centre` grow in proportion. matrix: affine, for column vectors.
/// Errors: `not_finite`; `singular_matrix`.
Eigen::Matrix4d part_of_motion(const Eigen::Matrix4d& matrix, const Eigen::RowVector3d& centre,
                               double part);

/// How much of a correction is applied at a frame: 0 up to `first` and from `last` on, 1 between
/// first + ease_in and last - ease_out, and between them 6 t^5 - 15 t^4 + 10 t^3 (Perlin 2002),
/// whose velocity and acceleration are 0 at both ends. Where the eases overlap, the product of
/// both. An ease of 0 frames is a jump, at the end itself included: 1 at `first`.
/// Errors: `bad_option` if last < first, or an ease is negative or not finite.
double range_share(double frame, double first, double last, double ease_in, double ease_out);

/// One frame to correct.
struct SequenceFrame {
  Points vertices;  ///< n x 3, caller's units, as the animation has them
  /// One a handle: its motion (4 x 4, affine, for column vectors) as a correction of the rest
  /// shape, in the caller's units; none: the handle stays where the animation has it.
  std::vector<std::optional<Eigen::Matrix4d>> corrections;
  double share = 1.0;  ///< how much of every correction: `range_share`
};

/// Corrects frames of an animation of a prepared mesh. Immutable.
class SequenceEditor {
 public:
  /// Errors: `bad_option` for options `EditSession` refuses.
  SequenceEditor(std::shared_ptr<const Editor> editor, const EditOptions& options);

  /// The frame's vertices, n x 3, edited: a handle's are at `F C F^-1` of where the animation has
  /// them, with F its `handle_frame` and C the frame's share of its correction. A frame that asks
  /// for nothing comes back bit for bit. From this frame alone, on one thread, so the bytes depend
  /// on neither the number of threads nor what was solved before. Errors: those of `StartPose` and
  /// `Editor::solve`; `wrong_shape` if corrections are not one a handle.
  Points solve(const SequenceFrame& frame) const;
  /// The same of several frames, shared among the threads.
  std::vector<Points> solve(const std::vector<SequenceFrame>& frames,
                            ProgressRange progress = {}) const;

 private:
  std::shared_ptr<const Editor> editor_;
  EditOptions options_;
};

}  // namespace supple
