// SPDX-License-Identifier: GPL-3.0-or-later
// What a round does on one face, of some blocks of faces. J is the Jacobian of the moved vertices
// from rest, S another Jacobian that the face may have been given before (I where `stretch` is
// nullptr), Q the rotation with the least |J - S Q|.
#pragma once

#include "face_blocks.h"
#include "geometry/corner_forces.h"

namespace supple {

enum class RoundKind {
  turned,     ///< forces towards S W R, R the rotation about given vectors' mean
  rotations,  ///< forces towards S Q
  find,       ///< no forces; Q is the result
  bounded,    ///< forces towards S B with B a given X, brought nearer to a rotation
};

struct RoundTask {
  const FaceBlocks* faces;
  const double* moved;         ///< n x 3
  const MatrixBlock* stretch;  ///< S, a block; or nullptr
  const double* vectors;       ///< `turned`: n x 3, rotation vectors at vertices
  const double* whole;         ///< `turned`: W, 9 numbers
  const double* given;         ///< `bounded`: X, m x 9
  double share, most;          ///< `bounded`: see `bound_stretch` in round_kernels.cpp
  MatrixBlock* kept;           ///< `bounded`: set to S P, with P what is left of X's stretch
  double* rotations;           ///< `find`: set to Q, m x 9
  CornerForces<float>* forces;
};

/// Blocks first..last-1, by the calling thread alone.
using RoundKernel = void (*)(const RoundTask& task, Eigen::Index first, Eigen::Index last);
RoundKernel round_kernel(RoundKind kind);

}  // namespace supple
