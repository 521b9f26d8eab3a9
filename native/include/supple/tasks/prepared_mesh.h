// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "supple/core/progress.h"
#include "supple/geometry/mesh.h"
#include "supple/geometry/surface_operators.h"
#include "supple/learning/network.h"
#include "supple/spectral/eigenbasis.h"

namespace supple {

struct PrepareOptions {
  int eigenfunctions = 128;
  /// Points the network is evaluated at; 0 for every vertex.
  int samples = 1024;
};

/// Everything about a rest mesh that no handle, target or network changes. Built once, then shared
/// by any number of editors; immutable.
struct PreparedMesh {
  /// Errors: those of `TriangleMesh` and `eigenbasis`; `bad_option`; `cancelled`.
  PreparedMesh(const Points& vertices, const Faces& faces, const PrepareOptions& options = {},
               ProgressRange progress = {});

  TriangleMesh mesh;
  SurfaceOperators operators;
  Eigenbasis basis;
  NetworkContext<float> sampled;
  /// The context a network is evaluated with: `paper` needs every vertex and is built when first
  /// asked.
  std::shared_ptr<const NetworkContext<float>> context_for(const Architecture& architecture) const;
};

}  // namespace supple
