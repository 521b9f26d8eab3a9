// SPDX-License-Identifier: GPL-3.0-or-later
// exp of the lanes of a vector: 2^k times a polynomial on |r| <= ln(2) / 2 (Cody and Waite 1980).
// By reference: a vector passed by value has another ABI for each instruction set.
#pragma once

#include <cstdint>

#include "supple/core/simd.h"

namespace supple {

/// To 2 units in the last place, |x| <= 87; beyond it, as there.
template <int Bytes>
SUPPLE_INLINE void exponential(typename Lanes<float, Bytes>::type& x) {
  using V = typename Lanes<float, Bytes>::type;
  using I = typename Lanes<int32_t, Bytes>::type;
  const V limit = V{} + 87.0f;
  x = x > limit ? limit : x;
  x = x < -limit ? -limit : x;
  // Adding 1.5 * 2^23 rounds to the nearest whole number.
  const V magic = V{} + 12582912.0f;
  const V k = (x * 1.44269504f + magic) - magic;
  const V r = (x - k * 0.693359375f) + k * 2.12194440e-4f;
  V p = r * 1.9875691500e-4f + 1.3981999507e-3f;
  p = p * r + 8.3334519073e-3f;
  p = p * r + 4.1665795894e-2f;
  p = p * r + 1.6666665459e-1f;
  p = p * r + 5.0000001201e-1f;
  p = p * (r * r) + r + 1.0f;
  const I bits = (__builtin_convertvector(k, I) + 127) << 23;
  x = p * reinterpret_cast<V>(bits);
}

/// To 2 units in the last place, -700 <= x < 700; below, as at -700. Taylor's polynomial: it rounds
/// more than its 14th term is.
template <int Bytes>
SUPPLE_INLINE void exponential(typename Lanes<double, Bytes>::type& x) {
  using V = typename Lanes<double, Bytes>::type;
  using I = typename Lanes<int64_t, Bytes>::type;
  const V limit = V{} - 700.0;
  x = x < limit ? limit : x;
  // Adding 1.5 * 2^52 rounds to the nearest whole number and leaves it in the lowest bits.
  const V magic = V{} + 6755399441055744.0;
  const V shifted = x * 1.4426950408889634 + magic;
  const V k = shifted - magic;
  const V r = (x - k * 0.693147180369123816490) - k * 1.90821492927058770002e-10;
  V p = r * (1.0 / 6227020800.0) + 1.0 / 479001600.0;
  p = p * r + 1.0 / 39916800.0;
  p = p * r + 1.0 / 3628800.0;
  p = p * r + 1.0 / 362880.0;
  p = p * r + 1.0 / 40320.0;
  p = p * r + 1.0 / 5040.0;
  p = p * r + 1.0 / 720.0;
  p = p * r + 1.0 / 120.0;
  p = p * r + 1.0 / 24.0;
  p = p * r + 1.0 / 6.0;
  p = p * r + 1.0 / 2.0;
  p = p * r + 1.0;
  p = p * r + 1.0;
  // Adds k to the exponent of p.
  const I bits = reinterpret_cast<I>(p) + (reinterpret_cast<I>(shifted) << 52);
  x = reinterpret_cast<V>(bits);
}

}  // namespace supple
