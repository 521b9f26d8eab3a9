// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/tasks/prepared_mesh.h"

#include <algorithm>
#include <string>
#include <vector>

#include "geometry/ordering.h"
#include "supple/core/content_hash.h"
#include "supple/core/error.h"

namespace supple {
namespace {

// Part of every key. Raise it when what is computed below changes, be it in the last bit, or the
// arrays that are kept do: files of before are then not met again, and go as the least recently
// used.
constexpr int kPreparedVersion = 4;

// Meshes of fewer vertices are not cached: they are prepared in less time than a file takes to be
// written to a disk.
constexpr Eigen::Index kFewestCached = 100;

void check_options(const PrepareOptions& options) {
  if (options.samples < 0 || options.eigenfunctions < 1) {
    throw Error(ErrorCode::bad_option, "Preparing needs at least 1 eigenfunction (not " +
                                           std::to_string(options.eigenfunctions) +
                                           ") and 0 or more samples.");
  }
}

// Everything that what is computed depends on.
std::string key_of(const SurfaceOperators& operators, const PrepareOptions& options) {
  const Eigen::Vector3i settings(kPreparedVersion, options.eigenfunctions, options.samples);
  return content_hash({bytes_of(settings), bytes_of(operators.vertices), bytes_of(operators.faces),
                       bytes_of(operators.component)});
}

// What takes long to compute, in the form in which it is kept.
struct Kept {
  Eigen::VectorXd residual{1};
  Eigen::VectorXi ordering, samples;
  RowMatrix<float> projector;

  std::vector<NamedArray> arrays(Eigenbasis& basis) {
    return {{"eigenfunctions", basis.functions},
            {"eigenvalues", basis.values},
            {"residual", residual},
            {"ordering", ordering},
            {"samples", samples},
            {"projector", projector}};
  }
};

}  // namespace

PreparedMesh::PreparedMesh(const Points& vertices, const Faces& faces,
                           const PrepareOptions& options, ProgressRange progress,
                           const PreparedCache* cache)
    : mesh(vertices, faces), operators(mesh), notes(mesh.notes()) {
  check_options(options);
  if (cache == nullptr || operators.vertices.rows() < kFewestCached) {
    compute(options, progress);
  } else {
    const std::string key = key_of(operators, options);
    from_cache = load(options, *cache, key);
    if (!from_cache) {
      compute(options, progress);
      store(*cache, key);
    }
  }
  progress.report(1.0);
}

void PreparedMesh::compute(const PrepareOptions& options, const ProgressRange& progress) {
  symbolic = std::make_shared<const SymbolicCholesky>(operators.laplacian);
  // One more than is used: where to cut is read from the gap above.
  basis = eigenbasis(operators.laplacian, operators.mass, {.count = options.eigenfunctions + 1},
                     progress.stage("eigenbasis", 0.05, 0.9), symbolic);
  sampled = NetworkContext<float>(operators, basis, options.eigenfunctions,
                                  Eigen::Index{options.samples});
}

bool PreparedMesh::load(const PrepareOptions& options, const PreparedCache& cache,
                        const std::string& key) {
  const Eigen::Index n = operators.vertices.rows();
  const Eigen::Index count = std::min<Eigen::Index>(options.eigenfunctions + 1, n);
  const Eigen::Index points = options.samples > 0 ? std::min<Eigen::Index>(options.samples, n) : n;
  Kept kept;
  // Checksums vouch for the bytes; this, that nothing below reads past an end whoever wrote them.
  const auto fits = [&] {
    return basis.functions.rows() == n && basis.functions.cols() == count &&
           basis.values.size() == count && kept.residual.size() == 1 &&
           is_ordering(kept.ordering, n) && kept.samples.size() == points &&
           kept.samples.minCoeff() >= 0 && kept.samples.maxCoeff() < n &&
           kept.projector.cols() == points &&
           kept.projector.rows() == basis.stable_count(options.eigenfunctions);
  };
  if (!cache.load(key, kept.arrays(basis), fits, notes)) {
    return false;
  }
  symbolic = std::make_shared<const SymbolicCholesky>(
      operators.laplacian, SymbolicCholesky::default_backend(), kept.ordering);
  basis.mass = operators.mass;
  basis.residual = kept.residual[0];
  sampled = NetworkContext<float>(operators, basis, options.eigenfunctions, std::move(kept.samples),
                                  std::move(kept.projector));
  return true;
}

void PreparedMesh::store(const PreparedCache& cache, const std::string& key) {
  Kept kept;
  kept.residual[0] = basis.residual;
  kept.ordering = symbolic->ordering();
  kept.samples = sampled.samples;
  kept.projector = sampled.domain.projector;
  cache.store(key, kept.arrays(basis), notes);
}

const std::shared_ptr<const PinnedLaplacian>& PreparedMesh::pinned() const {
  std::call_once(pinned_once_, [this] {
    pinned_ = std::make_shared<const PinnedLaplacian>(operators.laplacian, operators.mass,
                                                      operators.component,
                                                      operators.component_count, symbolic);
  });
  return pinned_;
}

std::shared_ptr<const NetworkContext<float>> PreparedMesh::context_for(
    const Architecture& architecture) const {
  if (architecture.configuration == Configuration::equivariant &&
      architecture.eigenfunctions + 1 >= basis.size()) {
    return {std::shared_ptr<void>(), &sampled};  // not owned: part of this mesh
  }
  const Eigen::Index samples =
      architecture.configuration == Configuration::paper ? 0 : sampled.samples.size();
  return std::make_shared<NetworkContext<float>>(operators, basis, architecture.eigenfunctions,
                                                 samples);
}

}  // namespace supple
