// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "supple/learning/network.h"
#include "supple/tasks/prepared_mesh.h"

namespace supple {

/// Recovers a pair's deformation from its spectral signal: the target's coordinates in `count`
/// eigenfunctions in, a detailed target (n x 3, in the caller's units) out. The paper, section 4.2.
///
/// target: n x 3, the same vertices as the prepared mesh. network: nullptr for the answer without
/// one (the coarse Jacobians through the same Poisson solve). Each component keeps its target's
/// centroid. Errors: `wrong_shape`; `bad_option` if count < 1 or the network takes another signal;
/// those of `TriangleMesh` for the target.
Points deform(const PreparedMesh& prepared, const Points& target, int count,
              const LocalJacobianNetwork<float>* network, ProgressRange progress = {});

}  // namespace supple
