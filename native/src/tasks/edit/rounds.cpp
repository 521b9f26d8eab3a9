// SPDX-License-Identifier: GPL-3.0-or-later
#include "rounds.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "core/prefetch.h"
#include "geometry/corner_forces.h"
#include "supple/geometry/jacobians.h"

namespace supple {
namespace {

// Faces worked on together: their matrices stay in the first-level cache.
constexpr Eigen::Index kChunk = 64;
using Chunk = Eigen::Matrix<double, kChunk, 9, Eigen::RowMajor>;

Eigen::Map<Matrix3> matrix_of(Chunk& chunk, Eigen::Index i) {
  return Eigen::Map<Matrix3>(chunk.data() + 9 * i);
}

// visit(first, count): some faces, by one thread.
template <class Visit>
void for_each_chunk(Eigen::Index faces, const Visit& visit) {
#pragma omp parallel for schedule(static)
  for (Eigen::Index first = 0; first < faces; first += kChunk) {
    visit(first, std::min(kChunk, faces - first));
  }
}

void jacobians_of(const SurfaceOperators& operators, const Points& moved, Eigen::Index first,
                  Eigen::Index count, Chunk& jacobians) {
  const Faces& faces = operators.faces;
  for (Eigen::Index i = 0; i < count; ++i) {
    if (first + i + kAhead < faces.rows()) {
      for (int c = 0; c < 3; ++c) {
        prefetch(moved.data() + 3 * faces(first + i + kAhead, c), 3 * sizeof(double));
      }
    }
    const auto face = faces.row(first + i);
    const Eigen::RowVector3d origin = moved.row(face[0]);
    const Eigen::RowVector3d e1 = moved.row(face[1]) - origin, e2 = moved.row(face[2]) - origin;
    Eigen::RowVector3d normal = e1.cross(e2);
    const double length = normal.norm();
    normal *= length > 0.0 ? 1.0 / length : 0.0;
    const auto inverse = matrix_at(operators.inverse_frames, first + i);
    matrix_of(jacobians, i).noalias() =
        inverse.col(0) * e1 + inverse.col(1) * e2 + inverse.col(2) * normal;
  }
}

// Sets `rotations` to the Q with the least |J - S Q|.
void rotations_past(const MatrixField& stretch, Eigen::Index first, Eigen::Index count,
                    Chunk& jacobians, double* rotations) {
  Chunk turned;
  for (Eigen::Index i = 0; i < count; ++i) {
    matrix_of(turned, i).noalias() =
        matrix_at(stretch, first + i).transpose() * matrix_of(jacobians, i);
  }
  closest_rotations(turned.data(), rotations, count, Precision::single);
}

// Sets rows of `away` to targets - jacobians. Rotations come in single precision; what differs no
// more than their rounding counts as reached, so that a rigid motion stays one exactly.
void difference(const Chunk& targets, const Chunk& jacobians, Eigen::Index count, Chunk& away) {
  constexpr double kRounding = 1e-6;
  for (Eigen::Index i = 0; i < count; ++i) {
    auto row = away.row(i);
    row = targets.row(i) - jacobians.row(i);
    if (row.squaredNorm() < kRounding * kRounding) {
      row.setZero();
    }
  }
}

}  // namespace

Points towards(const SurfaceOperators& operators, const Points& moved, const MatrixField& targets) {
  CornerForces forces(operators);
  for_each_chunk(operators.faces.rows(), [&](Eigen::Index first, Eigen::Index count) {
    Chunk j, target, away;
    jacobians_of(operators, moved, first, count, j);
    target.topRows(count) = targets.middleRows(first, count);
    difference(target, j, count, away);
    forces.set(first, count, away.data());
  });
  return forces.gathered();
}

Points towards_rotations(const SurfaceOperators& operators, const Points& moved) {
  CornerForces forces(operators);
  for_each_chunk(operators.faces.rows(), [&](Eigen::Index first, Eigen::Index count) {
    Chunk j, q, away;
    jacobians_of(operators, moved, first, count, j);
    closest_rotations(j.data(), q.data(), count, Precision::single);
    difference(q, j, count, away);
    forces.set(first, count, away.data());
  });
  return forces.gathered();
}

MatrixField rotations_of(const SurfaceOperators& operators, const Points& moved) {
  MatrixField rotations(operators.faces.rows(), 9);
  for_each_chunk(rotations.rows(), [&](Eigen::Index first, Eigen::Index count) {
    Chunk j;
    jacobians_of(operators, moved, first, count, j);
    closest_rotations(j.data(), rotations.row(first).data(), count, Precision::single);
  });
  return rotations;
}

MatrixField rotations_from(const SurfaceOperators& operators, const Points& moved,
                           const MatrixField& start) {
  MatrixField rotations(operators.faces.rows(), 9);
  for_each_chunk(rotations.rows(), [&](Eigen::Index first, Eigen::Index count) {
    Chunk j;
    jacobians_of(operators, moved, first, count, j);
    rotations_past(start, first, count, j, rotations.row(first).data());
  });
  return rotations;
}

void follow(const MatrixField& start, MatrixField& field) {
#pragma omp parallel for schedule(static)
  for (Eigen::Index f = 0; f < field.rows(); ++f) {
    matrix_at(field, f) = matrix_at(start, f) * Matrix3(matrix_at(field, f));
  }
}

Points towards_stretched(const SurfaceOperators& operators, const Points& moved,
                         const MatrixField& stretch) {
  CornerForces forces(operators);
  for_each_chunk(operators.faces.rows(), [&](Eigen::Index first, Eigen::Index count) {
    Chunk j, turned, q, away;
    jacobians_of(operators, moved, first, count, j);
    rotations_past(stretch, first, count, j, q.data());
    for (Eigen::Index i = 0; i < count; ++i) {
      matrix_of(turned, i).noalias() = matrix_at(stretch, first + i) * matrix_of(q, i);
    }
    difference(turned, j, count, away);
    forces.set(first, count, away.data());
  });
  return forces.gathered();
}

void bound_stretch(double share, double most, MatrixField& predicted, MatrixField& stretch) {
  stretch.resize(predicted.rows(), 9);
  for_each_chunk(predicted.rows(), [&](Eigen::Index first, Eigen::Index count) {
    Chunk q;
    closest_rotations(predicted.row(first).data(), q.data(), count, Precision::single);
    for (Eigen::Index i = 0; i < count; ++i) {
      auto jacobian = matrix_at(predicted, first + i);
      const Matrix3 away = jacobian * matrix_of(q, i).transpose() - Matrix3::Identity();
      const double size = away.norm();
      const Matrix3 kept = Matrix3::Identity() + (share * (size > most ? most / size : 1.0)) * away;
      matrix_at(stretch, first + i) = kept;
      jacobian.noalias() = kept * matrix_of(q, i);
    }
  });
}

}  // namespace supple
