// SPDX-License-Identifier: GPL-3.0-or-later
#include "rounds.h"

#include <algorithm>

#include "round_kernels.h"

namespace supple {
namespace {

RoundTask task_of(const FaceBlocks& faces, const Points& moved, const BlockField* start) {
  RoundTask task{};
  task.faces = &faces;
  task.moved = moved.data();
  task.stretch = start == nullptr ? nullptr : start->data();
  return task;
}

void run(RoundKind kind, const RoundTask& task) {
  constexpr Eigen::Index kTogether = 16;  // blocks
  const RoundKernel kernel = round_kernel(kind);
  const Eigen::Index blocks = block_count(task.faces->operators.faces.rows());
#pragma omp parallel for schedule(static)
  for (Eigen::Index first = 0; first < blocks; first += kTogether) {
    kernel(task, first, std::min(first + kTogether, blocks));
  }
}

Points forces(RoundKind kind, RoundTask task) {
  CornerForces<float> forces(task.faces->operators);
  task.forces = &forces;
  run(kind, task);
  return forces.gathered();
}

}  // namespace

Points towards_turned(const FaceBlocks& faces, const Points& moved,
                      const RowMatrix<double>& vectors, const Matrix3& whole,
                      const BlockField* start) {
  RoundTask task = task_of(faces, moved, start);
  task.vectors = vectors.data();
  task.whole = whole.data();
  return forces(RoundKind::turned, task);
}

Points towards_rotations(const FaceBlocks& faces, const Points& moved, const BlockField* start) {
  return forces(RoundKind::rotations, task_of(faces, moved, start));
}

MatrixField rotations_of(const FaceBlocks& faces, const Points& moved, const BlockField* start) {
  MatrixField result(faces.operators.faces.rows(), 9);
  RoundTask task = task_of(faces, moved, start);
  task.rotations = result.data();
  run(RoundKind::find, task);
  return result;
}

Points towards_bounded(const FaceBlocks& faces, const Points& moved, const MatrixField& predicted,
                       double share, double most, const BlockField* start, BlockField& stretch) {
  stretch.resize(faces.inverse_frames.size());
  RoundTask task = task_of(faces, moved, start);
  task.given = predicted.data();
  task.share = share;
  task.most = most;
  task.kept = stretch.data();
  return forces(RoundKind::bounded, task);
}

}  // namespace supple
