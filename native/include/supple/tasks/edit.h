// SPDX-License-Identifier: GPL-3.0-or-later
// Editing: handles in, a posed mesh out. Source: the paper, section 4.4.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "supple/core/progress.h"
#include "supple/geometry/held_system.h"
#include "supple/learning/network.h"
#include "supple/tasks/prepared_mesh.h"

namespace supple {

/// Mesh vertices that are told where to be.
struct Handle {
  std::string name;
  Eigen::VectorXi vertices;  ///< 0-based; distinct, also between handles
};

/// Where a handle's vertices are to be, in the caller's units. Neither set: held where they are.
struct HandleTarget {
  std::optional<Eigen::Matrix4d> matrix;  ///< for column vectors, on rest positions; invertible
  std::optional<Points> positions;        ///< one row a vertex of the handle
};

enum class EditMode {
  natural,  ///< ends with the network's Jacobians
  stiff,    ///< ends with local-global passes towards rotations: least distortion
};
/// Errors: `bad_option` for any other name.
EditMode edit_mode(const std::string& name);

enum class LoosePieces {
  follow,  ///< a component without a handle moves rigidly with the nearest point of one that has
           ///< one
  stay,    ///< it stays where it is
};

struct EditOptions {
  EditMode mode = EditMode::natural;
  int rounds = 3;  ///< of closest rotations and Poisson
  /// How many of the rounds, the last ones, put the network in between. It is trained on what
  /// rounds without it leave, not on its own results.
  int network_rounds = 1;
  int passes = 40;  ///< of closest rotations, Poisson, after the rounds; `stiff` only
  bool network = true;
  LoosePieces loose_pieces = LoosePieces::follow;
};

/// What was done, stage by stage.
struct EditReport {
  int rounds = 0, passes = 0;
  bool network = false;
  double suggestion_milliseconds = 0.0, rounds_milliseconds = 0.0, passes_milliseconds = 0.0,
         total_milliseconds = 0.0;
};

struct EditResult {
  Points vertices;  ///< n x 3, in the caller's units; handle vertices exactly on their targets
  EditReport report;
};

/// Handles bound to a prepared mesh: the systems are factored once, and solved for any targets.
class Editor {
 public:
  /// network: nullptr to edit without one (the closest rotations themselves are the Jacobians).
  /// Errors: `no_handles`, `empty_handle`, `index_out_of_range`, `overlapping_handles`;
  /// `bad_option` if the network takes another signal. Messages name the handle.
  Editor(std::shared_ptr<const PreparedMesh> prepared, std::vector<Handle> handles,
         std::shared_ptr<const LocalJacobianNetwork<float>> network, ProgressRange progress = {});

  /// targets: one a handle, in order. Safe to call from several threads.
  /// Errors: `wrong_shape`, `not_finite`, `singular_matrix`, `bad_option`, `cancelled`.
  EditResult solve(const std::vector<HandleTarget>& targets, const EditOptions& options = {},
                   ProgressRange progress = {}) const;

  const std::vector<Handle>& handles() const { return handles_; }

 private:
  /// Targets of every handle vertex, in handle order, in the caller's units.
  Points target_positions(const std::vector<HandleTarget>& targets) const;
  /// The one rigid motion nearest to what all handles ask, on surface vertices.
  Points moved_as_one(const std::vector<HandleTarget>& targets, const Points& held) const;
  /// The smooth first guess: the rigid motion, then biharmonic interpolation of what is left.
  Points suggestion(const Points& rigid, const Points& held) const;
  void place_loose_pieces(Points& moved, const MatrixField& vertex_jacobians,
                          LoosePieces choice) const;

  std::shared_ptr<const PreparedMesh> prepared_;
  std::vector<Handle> handles_;
  std::shared_ptr<const LocalJacobianNetwork<float>> network_;
  std::shared_ptr<const NetworkContext<float>> context_;
  Eigen::VectorXi held_;  // surface vertices in the systems' held set: handles, then loose pieces
  Eigen::VectorXi held_slot_;     // for each handle vertex in order: its place in held_, or -1
  Eigen::Index handle_rows_ = 0;  // how many of held_ belong to handles
  Eigen::VectorXi anchor_;        // per component: surface vertex it follows, -1 if it has a handle
  std::unique_ptr<HeldSystem> biharmonic_, poisson_;
};

}  // namespace supple
