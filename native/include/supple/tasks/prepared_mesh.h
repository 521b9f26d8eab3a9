// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "supple/core/progress.h"
#include "supple/geometry/mesh.h"
#include "supple/geometry/pinned_laplacian.h"
#include "supple/geometry/sparse_cholesky.h"
#include "supple/geometry/surface_operators.h"
#include "supple/learning/network.h"
#include "supple/spectral/eigenbasis.h"
#include "supple/tasks/prepared_cache.h"

namespace supple {

struct PrepareOptions {
  int eigenfunctions = 128;
  /// Points the network is evaluated at; 0 for every vertex.
  int samples = 1024;
};

/// Everything about a rest mesh that no handle, target or network changes. Built once, then shared
/// by any number of editors; immutable.
struct PreparedMesh {
  /// cache: where what takes long is looked for, and kept once computed; nullptr for nowhere. What
  /// comes from it is what was computed, bit for bit. Not needed after this returns.
  /// Errors: those of `TriangleMesh` and `eigenbasis`; `bad_option`; `cancelled`. A cache that
  /// fails is no error: `notes` says so.
  PreparedMesh(const Points& vertices, const Faces& faces, const PrepareOptions& options = {},
               ProgressRange progress = {}, const PreparedCache* cache = nullptr);

  TriangleMesh mesh;
  SurfaceOperators operators;
  /// Analysis of the Laplacian's pattern, for every system that has it: shifted, held, recovery.
  std::shared_ptr<const SymbolicCholesky> symbolic;
  Eigenbasis basis;
  NetworkContext<float> sampled;
  bool from_cache = false;
  /// Those of the mesh, then the cache's: `cache_rebuilt`, `cache_unwritable`, `cache_too_small`.
  std::vector<Note> notes;
  /// The context a network is evaluated with: `paper` needs every vertex and is built when first
  /// asked.
  std::shared_ptr<const NetworkContext<float>> context_for(const Architecture& architecture) const;
  /// The factor that any handles are held with; made when first asked.
  const std::shared_ptr<const PinnedLaplacian>& pinned() const;

 private:
  void compute(const PrepareOptions& options, const ProgressRange& progress);
  bool load(const PrepareOptions& options, const PreparedCache& cache, const std::string& key);
  void store(const PreparedCache& cache, const std::string& key);

  mutable std::once_flag pinned_once_;
  mutable std::shared_ptr<const PinnedLaplacian> pinned_;
};

}  // namespace supple
