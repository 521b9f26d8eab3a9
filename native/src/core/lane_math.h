// SPDX-License-Identifier: GPL-3.0-or-later
// Elementary functions of vectors of lanes, for which the compiler has no operator.
#pragma once

#include <cstdint>
#include <type_traits>

#include "supple/core/simd.h"

namespace supple {

/// Sets y to 1 / sqrt(x), x >= 0, to 3% and with each of Steps to the square of that: 4 reach
/// double precision, 3 single. Of 0 it is some large number, so that 0 times it is 0.
template <class Scalar, int Bytes, int Steps>
SUPPLE_INLINE void inverse_root(const typename Lanes<Scalar, Bytes>::type& x,
                                typename Lanes<Scalar, Bytes>::type& y) {
  constexpr bool kDouble = std::is_same_v<Scalar, double>;
  using Integer = std::conditional_t<kDouble, std::int64_t, std::int32_t>;
  using V = typename Lanes<Scalar, Bytes>::type;
  using I = typename Lanes<Integer, Bytes>::type;
  // Half of minus the exponent, and a straight line for the rest (Lomont 2003).
  constexpr Integer kMagic =
      kDouble ? static_cast<Integer>(0x5fe6eb50c7b537a9LL) : static_cast<Integer>(0x5f375a86);
  y = (V)(kMagic - ((I)x >> 1));
  for (int step = 0; step < Steps; ++step) {
    y *= Scalar(1.5) - Scalar(0.5) * x * y * y;
  }
}

/// Transposes as many vectors as each has lanes, in place.
template <class Scalar, int Bytes>
SUPPLE_INLINE void transpose_lanes(typename Lanes<Scalar, Bytes>::type* rows) {
  using Integer = std::conditional_t<std::is_same_v<Scalar, double>, std::int64_t, std::int32_t>;
  using V = typename Lanes<Scalar, Bytes>::type;
  using I = typename Lanes<Integer, Bytes>::type;
  constexpr int kLanes = Lanes<Scalar, Bytes>::count;
#pragma GCC unroll 4
  for (int step = 1; step < kLanes; step *= 2) {  // exchanges blocks of step x step
    I low = {}, high = {};
    for (int l = 0; l < kLanes; ++l) {
      const bool first = (l & step) == 0;
      low[l] = first ? l : kLanes + l - step;
      high[l] = first ? l + step : kLanes + l;
    }
#pragma GCC unroll 16
    for (int i = 0; i < kLanes; ++i) {
      if ((i & step) == 0) {
        const V a = rows[i], b = rows[i + step];
#ifdef __clang__  // which has no shuffle by a vector
        for (int l = 0; l < kLanes; ++l) {
          rows[i][l] = low[l] < kLanes ? a[low[l]] : b[low[l] - kLanes];
          rows[i + step][l] = high[l] < kLanes ? a[high[l]] : b[high[l] - kLanes];
        }
#else
        rows[i] = __builtin_shuffle(a, b, low);
        rows[i + step] = __builtin_shuffle(a, b, high);
#endif
      }
    }
  }
}

}  // namespace supple
