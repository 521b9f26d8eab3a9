// SPDX-License-Identifier: GPL-3.0-or-later
#include "softmax.h"

#include <algorithm>
#include <cstdint>
#include <cstring>

#include "supple/core/simd.h"

namespace supple {
namespace {

// exp of each lane, x <= 0: 2^k times Taylor's polynomial on |r| <= ln(2) / 2, which rounds more
// than its 14th term is (reduction as in Cody and Waite 1980).
// By reference: a vector passed by value has another ABI for each instruction set.
template <int Bytes, class V>
SUPPLE_INLINE void exponential(V& x) {
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

template <int Bytes>
SUPPLE_INLINE void softmax_row(double* row, Eigen::Index count, double temperature) {
  using V = typename Lanes<double, Bytes>::type;
  constexpr Eigen::Index lanes = Lanes<double, Bytes>::count;
  const Eigen::Index whole = count - count % lanes;
  double largest = row[count - 1];
  V top = V{} + largest;
  for (Eigen::Index i = 0; i < whole; i += lanes) {
    V value;
    std::memcpy(&value, row + i, Bytes);
    top = value > top ? value : top;
  }
  for (Eigen::Index l = 0; l < lanes; ++l) {
    largest = std::max(largest, static_cast<double>(top[l]));
  }
  for (Eigen::Index i = whole; i < count; ++i) {
    largest = std::max(largest, row[i]);
  }

  V sums = {};
  double sum = 0.0;
  for (Eigen::Index i = 0; i < whole; i += lanes) {
    V value;
    std::memcpy(&value, row + i, Bytes);
    value = (value - largest) / temperature;
    exponential<Bytes>(value);
    std::memcpy(row + i, &value, Bytes);
    sums += value;
  }
  for (Eigen::Index l = 0; l < lanes; ++l) {
    sum += sums[l];
  }
  if (whole < count) {
    const auto rest = static_cast<size_t>(count - whole);
    V value = V{} + largest;
    std::memcpy(&value, row + whole, rest * sizeof(double));
    value = (value - largest) / temperature;
    exponential<Bytes>(value);
    std::memcpy(row + whole, &value, rest * sizeof(double));
    for (Eigen::Index i = whole; i < count; ++i) {
      sum += row[i];
    }
  }

  const double share = 1.0 / sum;
  for (Eigen::Index i = 0; i < count; ++i) {
    row[i] *= share;
  }
}

using Row = void (*)(double*, Eigen::Index, double);

SUPPLE_AVX512 void softmax_avx512(double* row, Eigen::Index count, double temperature) {
  softmax_row<64>(row, count, temperature);
}
SUPPLE_AVX2 void softmax_avx2(double* row, Eigen::Index count, double temperature) {
  softmax_row<32>(row, count, temperature);
}
void softmax_plain(double* row, Eigen::Index count, double temperature) {
  softmax_row<16>(row, count, temperature);
}

}  // namespace

void softmax(double* row, Eigen::Index count, double temperature) {
  static const Row kernel = best_kernel<Row>(softmax_avx512, softmax_avx2, softmax_plain);
  kernel(row, count, temperature);
}

}  // namespace supple
