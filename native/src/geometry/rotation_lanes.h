// SPDX-License-Identifier: GPL-3.0-or-later
// Closest rotations of several 3x3 matrices at once, number e of all of them in vector e.
#pragma once

#include "core/lane_math.h"

namespace supple {

// Quadratic: a last change below `done` leaves less than rounding. Of what begins below `singular`,
// rounding would choose the rotation.
template <class Scalar>
struct RotationLimits;
template <>
struct RotationLimits<double> {
  static constexpr double done = 1e-15, singular = 1e-6;
};
template <>
struct RotationLimits<float> {
  static constexpr float done = 1e-8F, singular = 1e-3F;
};

/// Cofactors of 3x3 matrices.
template <class V>
SUPPLE_INLINE void cofactors(const V* q, V* out) {
  for (int i = 0; i < 3; ++i) {
    const int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
    for (int j = 0; j < 3; ++j) {
      const int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      out[3 * i + j] = q[3 * i1 + j1] * q[3 * i2 + j2] - q[3 * i1 + j2] * q[3 * i2 + j1];
    }
  }
}

/// Sets q (9 vectors: J) to the closest rotations, and good[l] (one a lane) to
/// whether lane l is there; where not, J is near a singular or mirrored matrix, or 0, and needs
/// `closest_rotation`.
///
/// Newton's iteration. With singular values s (the last one negative where J is mirrored),
/// J + cofactor(J) has s1 + s2 s3, s2 + s3 s1, s3 + s1 s2 in the same directions, so the same
/// closest rotation, but is far from singular even where J has rank 2: a few steps do, without
/// scaling.
template <class Scalar, int Bytes>
SUPPLE_INLINE void rotation_lanes(typename Lanes<Scalar, Bytes>::type* q, bool* good) {
  using V = typename Lanes<Scalar, Bytes>::type;
  using Limits = RotationLimits<Scalar>;
  constexpr int kLanes = Lanes<Scalar, Bytes>::count;
  constexpr int kFirst = 3, kSteps = 9;  // steps before the first look, and at most
  constexpr Scalar kHalf(0.5);
  V cofactor[9], change{}, square{}, start{}, scale;
  for (int e = 0; e < 9; ++e) {
    square += q[e] * q[e];
  }
  inverse_root<Scalar, Bytes, 1>(square * Scalar(1.0 / 3.0), scale);
  for (int e = 0; e < 9; ++e) {
    q[e] *= scale;
  }
  cofactors(q, cofactor);
  for (int e = 0; e < 9; ++e) {
    q[e] = kHalf * (q[e] + cofactor[e]);
  }
  for (int step = 0; step < kSteps; ++step) {
    cofactors(q, cofactor);
    const V determinant = q[0] * cofactor[0] + q[1] * cofactor[1] + q[2] * cofactor[2];
    const V half_inverse = kHalf / determinant;
    start = step == 0 ? determinant : start;
    change = V{};
    for (int e = 0; e < 9; ++e) {
      const V next = kHalf * q[e] + half_inverse * cofactor[e];
      const V moved = next - q[e];
      change += moved * moved;
      q[e] = next;
    }
    bool done = step + 1 >= kFirst;
    for (int l = 0; done && l < kLanes; ++l) {
      done = change[l] < Limits::done;
    }
    if (done) {
      break;
    }
  }
  cofactors(q, cofactor);
  const V determinant = q[0] * cofactor[0] + q[1] * cofactor[1] + q[2] * cofactor[2];
  for (int l = 0; l < kLanes; ++l) {
    good[l] = change[l] < Limits::done && start[l] > Limits::singular && determinant[l] > kHalf;
  }
}

}  // namespace supple
