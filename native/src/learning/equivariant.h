// SPDX-License-Identifier: GPL-3.0-or-later
// Invariants and equivariant matrices of Configuration::equivariant; see learning/network.h.
#pragma once

#include <array>
#include <vector>

#include "supple/learning/network.h"

namespace supple::equivariant {

constexpr int kScaleCount = 5;
/// Eigenfunctions of scale s: 8 << s, at most 128.
constexpr Eigen::Index scale_limit(int s) { return Eigen::Index{8} << s; }

/// Matrices whose invariants are taken: each field as it is and at every scale.
constexpr int matrix_count(int fields) { return fields * (1 + kScaleCount); }
constexpr int input_count(int fields) {
  const int n = matrix_count(fields);
  return n * (n + 1) + n + 2 * kScaleCount;
}
/// B_b: all matrices but the last field itself, with and without P, and Y Y^T L of the last field.
constexpr int basis_count(int fields) { return 2 * (matrix_count(fields) - 1) + kScaleCount; }
constexpr int kMaxFields = 2;

template <class Scalar>
using Mat3 = Eigen::Matrix<Scalar, 3, 3, Eigen::RowMajor>;
template <class Scalar>
using Row3 = Eigen::Matrix<Scalar, 1, 3>;

/// The matrices B_b - L of one face, for matrices given without a reference C that they share:
/// fields X_i - C and smooth Y_is - C (fields * kScaleCount of them). Where all are equal, every
/// one is 0, not 0 to the rounding of C. reference_defect: C C^T - I; normal: the rest normal.
template <class Scalar>
std::array<Mat3<Scalar>, basis_count(kMaxFields)> face_bases(
    const std::vector<Mat3<Scalar>>& fields, const std::vector<Mat3<Scalar>>& smooth,
    const Row3<Scalar>& normal, const Mat3<Scalar>& reference,
    const Mat3<Scalar>& reference_defect) {
  std::array<Mat3<Scalar>, basis_count(kMaxFields)> bases;
  const Mat3<Scalar>& lead = fields.back();
  const Mat3<Scalar> whole_lead = reference + lead;
  const Mat3<Scalar> along_normal = normal.transpose() * normal;
  size_t next = 0;
  const auto add = [&](const Mat3<Scalar>& matrix) {
    bases[next++] = matrix - lead;
    bases[next] = along_normal * bases[next - 1];
    ++next;
  };
  for (size_t i = 0; i + 1 < fields.size(); ++i) {
    add(fields[i]);
  }
  for (const auto& matrix : smooth) {
    add(matrix);
  }
  for (size_t s = smooth.size() - kScaleCount; s < smooth.size(); ++s) {
    // Y Y^T - I with Y = C + e.
    const Mat3<Scalar> mixed = reference * smooth[s].transpose();
    const Mat3<Scalar> defect =
        reference_defect + mixed + mixed.transpose() + smooth[s] * smooth[s].transpose();
    bases[next++] = defect * whole_lead;
  }
  return bases;
}

/// Invariants of one vertex, written to `out` (input_count - 2 kScaleCount numbers).
template <class Scalar>
void point_invariants(const std::vector<Mat3<Scalar>>& matrices, const Row3<Scalar>& normal,
                      Scalar* out) {
  for (size_t a = 0; a < matrices.size(); ++a) {
    const Row3<Scalar> normal_a = normal * matrices[a];
    for (size_t b = a; b < matrices.size(); ++b) {
      *out++ = matrices[a].cwiseProduct(matrices[b]).sum();
      *out++ = normal_a.dot(normal * matrices[b]);
    }
    *out++ = matrices[a].determinant();
  }
}

}  // namespace supple::equivariant
