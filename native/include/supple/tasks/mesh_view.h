// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "supple/core/types.h"

namespace supple {

/// A mesh as the caller has it: n x 3 vertices in any units, m x 3 faces, not owned. Faces without
/// area and vertices without faces are welcome.
struct MeshView {
  const Points& vertices;
  const Faces& faces;
};

}  // namespace supple
