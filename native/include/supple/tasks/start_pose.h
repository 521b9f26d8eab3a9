// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "supple/tasks/prepared_mesh.h"

namespace supple {

/// A pose of a prepared mesh that an edit starts from in place of the rest shape, such as a frame
/// of an animation. The rest mesh's operators, eigenfunctions and factors serve every pose of it:
/// what the edit asks of a face multiplies the face's Jacobian from rest to this pose, so that with
/// nothing asked the pose itself is the solution of the Poisson equation.
struct StartPose {
  /// vertices: n x 3, finite, the mesh's vertices in the caller's units.
  /// Errors: `wrong_shape`, `not_finite`; the message names the first bad vertex.
  StartPose(const PreparedMesh& prepared, Points vertices);

  Points mesh_vertices;   ///< n x 3, as given
  Points vertices;        ///< ns x 3, surface units of the rest mesh
  MatrixField jacobians;  ///< ms x 9, rest to pose
  Points face_normals;    ///< ms x 3; a zero row where a face has no area
  Points vertex_normals;  ///< ns x 3
};

}  // namespace supple
