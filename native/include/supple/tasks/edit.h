// SPDX-License-Identifier: GPL-3.0-or-later
// Editing: handles in, a posed mesh out. Source: the paper, section 4.4; docs/method.md says where
// this differs.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "supple/core/progress.h"
#include "supple/geometry/held_system.h"
#include "supple/geometry/pinned_laplacian.h"
#include "supple/learning/network.h"
#include "supple/tasks/prepared_mesh.h"
#include "supple/tasks/start_pose.h"

namespace supple {

/// Mesh vertices that are told where to be.
struct Handle {
  std::string name;
  Eigen::VectorXi vertices;  ///< 0-based; distinct, also between handles
  /// 1: on its target exactly. From 0 to 1: a pull, which the rest of the mesh may resist; at 0.5
  /// about as strong as what it costs to move a single point of a surface whose edge is held.
  double weight = 1.0;
};

/// Where a handle's vertices are to be, in the caller's units. Neither set: held where they are.
struct HandleTarget {
  std::optional<Eigen::Matrix4d> matrix;  ///< for column vectors, on positions at the start (rest,
                                          ///< or a given pose); invertible
  std::optional<Points> positions;        ///< one row a vertex of the handle
};

enum class EditMethod {
  supple,  ///< the suggestion, the network, and passes towards least distortion
  arap,    ///< as rigid as possible, spokes and rims, from the same suggestion to its minimum
};
/// Errors: `bad_option` for any other name.
EditMethod edit_method(const std::string& name);

enum class LoosePieces {
  follow,  ///< a component without a handle moves rigidly with the nearest point of one that has
           ///< one
  stay,    ///< it stays where it is
};

struct EditOptions {
  EditMethod method = EditMethod::supple;
  /// From 0, natural: the network's Jacobians, to 1, stiff: least distortion. Between them the
  /// network's stretch counts for less and there are more passes. `supple` only.
  double stiffness = 0.0;
  int rounds = 2;  ///< of closest rotations and Poisson
  /// How many of the rounds, the last ones, put the network in between.
  int network_rounds = 1;
  /// Passes after the rounds that keep the network's stretch and let it turn with the result.
  int polish = 1;
  /// Most passes towards least distortion, of `arap` and where stiffness is 1; fewer where they
  /// have converged, up to three quarters more (`supple`) while faces are turned over.
  int passes = 80;
  bool network = true;
  /// Whether closed components whose handles keep their size get back most of the volume that the
  /// edit has lost. `supple` only.
  bool keep_volume = true;
  LoosePieces loose_pieces = LoosePieces::follow;
};

/// What was done, stage by stage.
struct EditReport {
  int rounds = 0, polish = 0, passes = 0;
  bool network = false;
  bool volume_kept = false;  ///< whether there was a component to do that for
  double suggestion_milliseconds = 0.0, rounds_milliseconds = 0.0, passes_milliseconds = 0.0,
         total_milliseconds = 0.0;
};

struct EditResult {
  /// n x 3, in the caller's units; vertices of handles of weight 1 exactly on their targets.
  Points vertices;
  EditReport report;
};

class EditSession;
class EnclosedVolume;
struct FaceBlocks;
struct SoftHandles;

/// Handles bound to a prepared mesh, for any targets. Immutable.
class Editor {
 public:
  /// network: nullptr to edit without one (the closest rotations themselves are the Jacobians).
  /// former: an editor of the same prepared mesh with other handles; what the two share is not
  /// computed again, and the result is the same to single precision.
  /// Errors: `no_handles`, `empty_handle`, `index_out_of_range`, `overlapping_handles`;
  /// `bad_option` for a weight outside of ]0, 1] or if the network takes another signal. Messages
  /// name the handle.
  Editor(std::shared_ptr<const PreparedMesh> prepared, std::vector<Handle> handles,
         std::shared_ptr<const LocalJacobianNetwork<float>> network, ProgressRange progress = {},
         const Editor* former = nullptr);

  /// targets: one a handle, in order. start: the pose to edit; nullptr for the rest shape. The same
  /// bytes for the same targets, options and start. Safe to call from several threads.
  /// Errors: `wrong_shape`, `not_finite`, `singular_matrix`, `bad_option`, `cancelled`.
  EditResult solve(const std::vector<HandleTarget>& targets, const EditOptions& options = {},
                   ProgressRange progress = {},
                   std::shared_ptr<const StartPose> start = nullptr) const;

  const std::vector<Handle>& handles() const { return handles_; }
  const PreparedMesh& prepared() const { return *prepared_; }

 private:
  friend class EditSession;
  void bind(const Editor* former, const ProgressRange& progress);

  std::shared_ptr<const PreparedMesh> prepared_;
  std::vector<Handle> handles_;
  std::shared_ptr<const LocalJacobianNetwork<float>> network_;
  std::shared_ptr<const NetworkContext<float>> context_;
  Eigen::VectorXi held_;          // surface vertices: the handles', then one of each loose piece
  Eigen::VectorXi held_slot_;     // for each handle vertex in order: its place in held_, or -1
  Eigen::VectorXi held_handle_;   // for each of held_: its handle, or -1
  Eigen::Index handle_rows_ = 0;  // how many of held_ belong to handles
  Eigen::VectorXi anchor_;        // per component: surface vertex it follows, -1 if it has a handle
  Eigen::VectorXi firm_;          // places in held_ that are on their targets exactly
  Eigen::VectorXi guides_;        // places in held_ whose rotations the suggestion interpolates
  std::shared_ptr<const SoftHandles> soft_;  // the other places
  std::shared_ptr<const HeldSystem> poisson_;
  std::shared_ptr<const BiharmonicInterpolation> interpolation_;
  std::shared_ptr<const EnclosedVolume> volume_;
  std::shared_ptr<const FaceBlocks> faces_;
};

/// An edit that goes on while its targets change: a drag. Not safe to share between threads.
class EditSession {
 public:
  /// Errors: `bad_option`.
  EditSession(std::shared_ptr<const Editor> editor, const EditOptions& options);
  ~EditSession();
  EditSession(EditSession&&) noexcept;

  /// New targets, and the pose to edit (nullptr: the rest shape); what was done for the last ones
  /// is dropped. Errors: those of `Editor::solve`.
  void aim(const std::vector<HandleTarget>& targets,
           std::shared_ptr<const StartPose> start = nullptr);
  /// Works until about this many milliseconds have passed, at least one step and to a usable pose,
  /// and returns it. Stopped at any time and called again, it ends where `Editor::solve` does.
  /// Errors: `bad_option` before the first `aim`.
  EditResult advance(double milliseconds);
  /// Whether another `advance` would change nothing.
  bool settled() const;

 private:
  friend class Editor;
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace supple
