// SPDX-License-Identifier: GPL-3.0-or-later
// Refining a map between two meshes: a rough one in, a smooth and accurate one out.
#pragma once

#include <memory>
#include <vector>

#include "supple/core/progress.h"
#include "supple/core/types.h"
#include "supple/geometry/mesh.h"
#include "supple/geometry/surface_map.h"
#include "supple/learning/network.h"
#include "supple/spectral/recovery.h"
#include "supple/tasks/prepared_mesh.h"

namespace supple {

enum class RefineMethod {
  recovery,  ///< the paper's: signal, network, embedding recovery, nearest points
  /// The map of the functional map alone, no embedding: what the others are measured beside. The
  /// paper, the Eqn after C_21.
  spectral_projection,
};
const char* to_string(RefineMethod method);
/// Errors: `bad_option` for any other name.
RefineMethod refine_method(const std::string& name);

struct RefineOptions {
  RefineMethod method = RefineMethod::recovery;
  /// Eigenfunctions of each round, >= 1. A round takes as many as both meshes have where it asks
  /// for more, and never cuts through a multiple eigenvalue.
  std::vector<int> counts = {80, 100, 120};
  /// Rounds after them that keep the last Jacobians: the points move, the surface's shape does not.
  int settling_rounds = 0;
  RecoveryOptions recovery;
  /// A nearest point counts where the cosine between the normals there is at least this, in [-1,
  /// 1]; -1: whatever they are. Keeps a thin part's sides apart.
  double facing = 0.0;
  /// How far a point that faces the right way is looked for, in roots of the area, > 0; where there
  /// is none, the nearest of all is taken.
  double facing_reach = 0.1;
  /// Also give the map from the target back to the source.
  bool backward = false;
};

struct RefineReport {
  int rounds = 0;
  int eigenfunctions = 0;  ///< of the last round with a signal
  bool network = false;
  /// Source faces that the network would have stretched beyond a norm of 4 (areas 1), in the last
  /// round with a signal: that many are where the map is torn. They are stretched so far and no
  /// further.
  int bounded_faces = 0;
  double signal_milliseconds = 0.0;  ///< pull-back and signal; the whole of `spectral_projection`
  double network_milliseconds = 0.0;
  double recovery_milliseconds = 0.0;
  double nearest_milliseconds = 0.0;
  double total_milliseconds = 0.0;
};

/// n source vertices, t target vertices, both as in the callers' meshes.
struct RefineResult {
  Eigen::VectorXi point_map;  ///< n, a target vertex each
  SurfaceMap surface_map;     ///< n, points on the target's faces
  Points recovered;           ///< n x 3: the source laid onto the target, in the target's units
  /// n, 0 to 1: exp(-d^2 / 2 h^2) max(0, cos a) exp(-r^2 / 8 h^2), with d the distance of the
  /// recovered vertex to the target, a the angle between their normals, r how far from where it
  /// started the way to the target and back to the nearest recovered vertex ends, and h = 2 /
  /// sqrt(faces) of the mesh with fewer, all with both areas 1.
  Eigen::VectorXd confidence;
  Eigen::VectorXi backward_point_map;  ///< t, a source vertex each; empty if not asked for
  SurfaceMap backward_surface_map;     ///< t, points on the source's faces; empty likewise
  RefineReport report;
};

/// What refining maps between two meshes needs, factored once; immutable, safe for several threads.
///
/// A round, from points y_i on the target for the source's vertices (the paper, section 4.3):
///
///     coarse   X = Phi_s Phi_s^+ (Phi_t Phi_t^+ V_t)(y) = Phi_s C_21 Phi_t^+ V_t     (Eqn 10)
///     signal   `spectral_signal` of the source and X                                 (Eqn 9)
///     network  a Jacobian J a face, no longer than 4; without one, the coarse Jacobian
///     recover  V near V_t(y) with Jacobians J                          (`EmbeddingRecovery`)
///     nearest  y <- the points of the target nearest to V, facing the same way
///
/// Both areas are 1 inside. The functional map C_21 is not formed: what is needed is its product
/// with three columns. Turning, moving or scaling either mesh leaves the map as it is.
class Refiner {
 public:
  using Network = LocalJacobianNetwork<float>;

  /// network: nullptr for the coarse Jacobians themselves.
  /// Errors: `bad_option` for options out of range, a network of another signal, or a mesh that is
  /// nullptr; those of `EmbeddingRecovery`.
  Refiner(std::shared_ptr<const PreparedMesh> source, std::shared_ptr<const PreparedMesh> target,
          std::shared_ptr<const Network> network, RefineOptions options = {},
          ProgressRange progress = {});
  ~Refiner();

  const RefineOptions& options() const;
  /// Where the meshes differ in what a map can't respect: "components_differ",
  /// "boundaries_differ"; and "fewer_eigenfunctions" than a round asks for.
  const std::vector<Note>& notes() const;

  /// point_map: n, a target vertex for each source vertex. One without a face takes its nearest
  /// surface vertex's place, on either mesh.
  /// Errors: `wrong_shape`, `index_out_of_range`; `cancelled`.
  RefineResult refine(const Eigen::VectorXi& point_map, ProgressRange progress = {}) const;
  /// The same from points inside the target's faces; none may be without a partner.
  /// Errors: those of `check_surface_map`; `index_out_of_range` for a face of -1 or without area.
  RefineResult refine(const SurfaceMap& map, ProgressRange progress = {}) const;

 private:
  struct Impl;
  std::unique_ptr<const Impl> impl_;
};

}  // namespace supple
