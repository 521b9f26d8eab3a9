// SPDX-License-Identifier: GPL-3.0-or-later
// What a round does on one face, of some blocks of faces. J is the Jacobian of the moved vertices
// from rest, S another Jacobian that the face may have been given before (I where `stretch` is
// nullptr), Q the rotation with the least |J - S Q|.
#pragma once

#include "face_blocks.h"
#include "geometry/corner_forces.h"

namespace supple {

enum class RoundKind {
  given,      ///< forces towards S X, X given
  rotations,  ///< forces towards S Q
  find,       ///< no forces; Q is the result
  bounded,    ///< forces towards S B with B the given X, brought nearer to a rotation
};

struct RoundTask {
  const FaceBlocks* faces;
  const double* moved;         ///< n x 3
  const MatrixBlock* stretch;  ///< S, a block; or nullptr
  const double* given;         ///< X, m x 9
  double share, most;          ///< `bounded`: see `bound_stretch` in round_kernels.cpp
  MatrixBlock* kept;           ///< `bounded`: set to S P, with P what is left of X's stretch
  double* rotations;           ///< `find`: set to Q, m x 9
  CornerForces<float>* forces;
};

/// Blocks first..last-1, by the calling thread alone.
using RoundKernel = void (*)(const RoundTask& task, Eigen::Index first, Eigen::Index last);
RoundKernel round_kernel(RoundKind kind);

}  // namespace supple
