// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "supple/core/types.h"

namespace supple {

/// The rotation vector (axis times angle in [0, pi], radians) of a rotation matrix.
Eigen::RowVector3d rotation_vector(const Matrix3& rotation);
/// Its inverse, for any angle. Source: Rodrigues.
Matrix3 rotation_matrix(const Eigen::RowVector3d& vector);

/// 3x3 gradient with respect to J, from that with respect to its `closest_rotation` (jacobians.h).
/// With J = W Q and s the eigenvalues of W, the singular values of J (the last one negative where J
/// is mirrored), a change of J turns Q by its skew part over s_i + s_j. Where that sum is below
/// 1e-9 of |J| the closest rotation is not unique and its derivative has no bound: taken as 0
/// there. Source: Papadopoulo and Lourakis 2000 (derivatives of the SVD), for U V^T.
Matrix3 closest_rotation_backward(const Matrix3& j, const Matrix3& grad);

}  // namespace supple
