// SPDX-License-Identifier: GPL-3.0-or-later
// Configuration::equivariant (learning/network.h): invariants in, equivariant matrices out.
//
// Everything that is smooth lives in the eigenfunctions: k x c coefficients. Only two products of a
// thin matrix touch every vertex, one to project the signal (`project_fields`) and one to expand
// its scales and the network's answer (`correct_faces`).
#pragma once

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
/// Coefficients c_b: all matrices but the last field itself, with and without P, and Y Y^T L of the
/// last field.
constexpr int output_count(int fields) { return 2 * (matrix_count(fields) - 1) + kScaleCount; }
constexpr int kMaxFields = 2;

template <class Scalar>
using Mat3 = Eigen::Matrix<Scalar, 3, 3, Eigen::RowMajor>;
template <class Scalar>
using Row3 = Eigen::Matrix<Scalar, 1, 3>;

/// A signal, ready for a network. What all its matrices share, a reference C, is taken out before
/// anything is rounded to Scalar: where all are equal, every correction is 0, not 0 to the rounding
/// of C.
template <class Scalar>
struct Fields {
  const Signal* signal;             ///< not owned
  const SurfaceLook<Scalar>* look;  ///< not owned; the rest shape's as `project_fields` leaves it
  Matrix3 reference;                ///< the mean of the last field by area; turns as the fields do
  RowMatrix<Scalar> coefficients;   ///< k x 16 a field: 9 numbers of (X_i - C), the rest 0
};

/// Averages the signal's fields to vertices and projects them to the context's eigenfunctions.
template <class Scalar>
Fields<Scalar> project_fields(const NetworkContext<Scalar>& context, const Signal& signal);

/// p x input_count: the invariants at the context's samples.
template <class Scalar>
RowMatrix<Scalar> invariants(const NetworkContext<Scalar>& context, const Fields<Scalar>& fields);

/// m x 9 Jacobians: the signal's last field plus sum_b c_b (B_b - L), for k x output_count
/// coefficients of the c_b. The smooth matrices are combined at vertices, and the combinations
/// averaged to faces.
template <class Scalar>
MatrixField correct_faces(const NetworkContext<Scalar>& context, const Fields<Scalar>& fields,
                          const RowMatrix<Scalar>& outputs);

/// k x output_count: gradient with respect to `outputs` from the m x 9 one with respect to the
/// Jacobians.
template <class Scalar>
RowMatrix<Scalar> correct_faces_backward(const NetworkContext<Scalar>& context,
                                         const Fields<Scalar>& fields, const MatrixField& grad);

/// The gradient with respect to the signal's fields, m x 9 each, from the m x 9 one with respect to
/// the Jacobians of `correct_faces(context, fields, outputs)` and from the p x input_count one with
/// respect to `invariants(context, fields)`, where `outputs` follow from these.
template <class Scalar>
Signal signal_gradient(const NetworkContext<Scalar>& context, const Fields<Scalar>& fields,
                       const RowMatrix<Scalar>& outputs, const MatrixField& grad,
                       const RowMatrix<Scalar>& grad_invariants);

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
