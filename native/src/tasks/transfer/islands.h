// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "supple/core/types.h"

namespace supple {

/// n: the connected component (by faces) of each vertex, 0-based in the order of the lowest vertex;
/// a vertex without faces is one of its own. faces: indices in [0, n).
Eigen::VectorXi islands_of(const Faces& faces, Eigen::Index n, int& count);

/// Errors: `index_out_of_range` naming the first face of `which` with a vertex outside [0, n).
void check_faces(const Faces& faces, Eigen::Index n, const char* which);

/// Mean length of the faces' edges.
double mean_edge(const Points& vertices, const Faces& faces);

/// Target vertices without a partner.
int count_unmapped(const Eigen::VectorXi& face);

}  // namespace supple
