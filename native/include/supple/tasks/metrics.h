// SPDX-License-Identifier: GPL-3.0-or-later
// Figures for an edited mesh. rest and posed: n x 3 in the same units; faces: m x 3.
#pragma once

#include "supple/core/types.h"

namespace supple {

/// m: symmetric Dirichlet distortion of each face, s1^2 + s2^2 + s1^-2 + s2^-2 - 4 with s the
/// singular values of its 2x2 Jacobian, not below 1e-6; 0 for a rigid motion, and for a face
/// without rest area. Source: Smith and Schaefer 2015.
Eigen::VectorXd face_distortion(const Points& rest, const Faces& faces, const Points& posed);

/// Mean of `face_distortion`, weighted by rest area.
double symmetric_dirichlet(const Points& rest, const Faces& faces, const Points& posed);

/// Number of faces newly turned over or collapsed. Turned over: the normal is more than 90 degrees
/// from the mean normal of the faces that share an edge, which at rest it was not. Collapsed: area
/// below 1e-6 of its rest area.
int flipped_faces(const Points& rest, const Faces& faces, const Points& posed);

/// Area-weighted RMS distance between posed and true vertices, over the square root of the rest
/// area, times 100. The mass is the rest mesh's (a third of each incident face).
double pose_error(const Points& rest, const Faces& faces, const Points& posed, const Points& truth);

}  // namespace supple
