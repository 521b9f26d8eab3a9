// SPDX-License-Identifier: GPL-3.0-or-later
#include "nearest_kernels.h"

#include "supple/core/simd.h"

namespace supple {
namespace {

template <int Bytes>
using Vector = typename Lanes<float, Bytes>::type;

// By reference: a vector wider than plain x86-64's is no value to return.
template <int Bytes>
SUPPLE_INLINE void load(const float* from, Vector<Bytes>& value) {
  typedef Vector<Bytes> Unaligned __attribute__((aligned(4), may_alias));
  value = *reinterpret_cast<const Unaligned*>(from);
}
template <int Bytes>
SUPPLE_INLINE void store(float* to, const Vector<Bytes>& value) {
  typedef Vector<Bytes> Unaligned __attribute__((aligned(4), may_alias));
  *reinterpret_cast<Unaligned*>(to) = value;
}

// Whether a number of the two is negative. By the sign bits: GCC makes scalar code of comparisons
// of vectors of 64 bytes.
template <int Bytes>
SUPPLE_INLINE bool any_negative(const Vector<Bytes>& a, const Vector<Bytes>& b) {
  typedef typename Lanes<long long, Bytes>::type Words;
  const Words words = reinterpret_cast<const Words&>(a) | reinterpret_cast<const Words&>(b);
  long long all = 0;
#pragma GCC unroll 8
  for (int i = 0; i < Bytes / 8; ++i) {
    all |= words[i];
  }
  return (static_cast<unsigned long long>(all) & 0x8000000080000000ULL) != 0;
}

template <int Bytes, int Height>
struct Scores {
  using V = Vector<Bytes>;
  static constexpr Eigen::Index lanes = Lanes<float, Bytes>::count, width = 2 * lanes;
  V a[Height], b[Height];

  SUPPLE_INLINE void add(const Pairing& pairing, Eigen::Index begin, Eigen::Index end) {
    for (Eigen::Index j = begin; j < end; ++j) {
      V u, v;
      load<Bytes>(pairing.queries + j * width, u);
      load<Bytes>(pairing.queries + j * width + lanes, v);
      const float* const y = pairing.points + j * Height;
#pragma GCC unroll 16
      for (int p = 0; p < Height; ++p) {
        a[p] += y[p] * u;
        b[p] += y[p] * v;
      }
    }
  }

  SUPPLE_INLINE void most(V& most_a, V& most_b) const {
    most_a = a[0], most_b = b[0];
#pragma GCC unroll 16
    for (int p = 1; p < Height; ++p) {
      most_a = a[p] > most_a ? a[p] : most_a;
      most_b = b[p] > most_b ? b[p] : most_b;
    }
  }
};

// Two vectors of queries against Height points, whose scores stay in registers. False where the
// first numbers were enough.
template <int Bytes, int Height>
SUPPLE_INLINE bool score_body(const Pairing& pairing) {
  using S = Scores<Bytes, Height>;
  using V = Vector<Bytes>;
  S scores;
  V most_a, most_b;
  const float* const offsets = pairing.first > 0 ? pairing.first_offsets : pairing.offsets;
#pragma GCC unroll 16
  for (int p = 0; p < Height; ++p) {
    scores.a[p] = scores.b[p] = V{} + offsets[p];
  }
  if (pairing.first > 0) {
    scores.add(pairing, 0, pairing.first);
    scores.most(most_a, most_b);
    V enough_a, enough_b;
    load<Bytes>(pairing.enough, enough_a);
    load<Bytes>(pairing.enough + S::lanes, enough_b);
    enough_a -= most_a;
    enough_b -= most_b;
    if (!any_negative<Bytes>(enough_a, enough_b)) {
      return false;
    }
#pragma GCC unroll 16
    for (int p = 0; p < Height; ++p) {
      const float rest = pairing.offsets[p] - offsets[p];
      scores.a[p] += rest;
      scores.b[p] += rest;
    }
  }
  scores.add(pairing, pairing.first, pairing.numbers);
#pragma GCC unroll 16
  for (int p = 0; p < Height; ++p) {
    store<Bytes>(pairing.scores + p * S::width, scores.a[p]);
    store<Bytes>(pairing.scores + p * S::width + S::lanes, scores.b[p]);
  }
  scores.most(most_a, most_b);
  store<Bytes>(pairing.best, most_a);
  store<Bytes>(pairing.best + S::lanes, most_b);
  return true;
}

// A point within `far` is within `far` + the radius of its tile's middle.
template <int Bytes>
SUPPLE_INLINE void reach_body(const Reach& reach) {
  using V = Vector<Bytes>;
  constexpr Eigen::Index lanes = Lanes<float, Bytes>::count;
  V far[2], far_squares[2];
  for (int i = 0; i < 2; ++i) {
    load<Bytes>(reach.far + i * lanes, far[i]);
    load<Bytes>(reach.far_squares + i * lanes, far_squares[i]);
  }
  for (Eigen::Index t = 0; t < reach.tiles; ++t) {
    V a, b;
    load<Bytes>(reach.away + 2 * t * lanes, a);
    load<Bytes>(reach.away + (2 * t + 1) * lanes, b);
    const float twice = 2.0F * reach.radii[t], square = reach.radii[t] * reach.radii[t];
    a -= twice * far[0] + far_squares[0] + square;
    b -= twice * far[1] + far_squares[1] + square;
    reach.within[t] = any_negative<Bytes>(a, b) ? 1 : 0;
  }
}

SUPPLE_AVX512 bool score_avx512(const Pairing& pairing) { return score_body<64, 12>(pairing); }
SUPPLE_AVX2 bool score_avx2(const Pairing& pairing) { return score_body<32, 6>(pairing); }
bool score_plain(const Pairing& pairing) { return score_body<16, 6>(pairing); }
SUPPLE_AVX512 void reach_avx512(const Reach& reach) { reach_body<64>(reach); }
SUPPLE_AVX2 void reach_avx2(const Reach& reach) { reach_body<32>(reach); }
void reach_plain(const Reach& reach) { reach_body<16>(reach); }

}  // namespace

NearestKernel nearest_kernel() {
  switch (simd_level()) {
    case SimdLevel::avx512:
      return {score_avx512, reach_avx512, 32, 12};
    case SimdLevel::avx2:
      return {score_avx2, reach_avx2, 16, 6};
    case SimdLevel::plain:
      break;
  }
  return {score_plain, reach_plain, 8, 6};
}

}  // namespace supple
