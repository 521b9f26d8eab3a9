// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/tasks/prepared_mesh.h"

#include <string>

#include "supple/core/error.h"

namespace supple {
namespace {

Eigenbasis prepare_basis(const SurfaceOperators& operators, const PrepareOptions& options,
                         const ProgressRange& progress) {
  if (options.samples < 0 || options.eigenfunctions < 1) {
    throw Error(ErrorCode::bad_option, "Preparing needs at least 1 eigenfunction (not " +
                                           std::to_string(options.eigenfunctions) +
                                           ") and 0 or more samples.");
  }
  // One more than is used: where to cut is read from the gap above.
  return eigenbasis(operators.laplacian, operators.mass, {.count = options.eigenfunctions + 1},
                    progress);
}

}  // namespace

PreparedMesh::PreparedMesh(const Points& vertices, const Faces& faces,
                           const PrepareOptions& options, ProgressRange progress)
    : mesh(vertices, faces),
      operators(mesh),
      basis(prepare_basis(operators, options, progress.stage("eigenbasis", 0.05, 0.9))),
      sampled(operators, basis, options.eigenfunctions, options.samples) {
  progress.report(1.0);
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
