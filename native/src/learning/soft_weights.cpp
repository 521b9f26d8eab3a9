// SPDX-License-Identifier: GPL-3.0-or-later
#include "soft_weights.h"

#include <cstring>

#include "exponential.h"
#include "supple/core/simd.h"

namespace supple {
namespace {

template <int Bytes, class Scalar>
SUPPLE_INLINE void body(const Scalar* x, Eigen::Index count, Scalar largest, Scalar temperature,
                        Scalar* weights) {
  using V = typename Lanes<Scalar, Bytes>::type;
  constexpr Eigen::Index lanes = Lanes<Scalar, Bytes>::count;
  const Eigen::Index whole = count - count % lanes;
  for (Eigen::Index i = 0; i < whole; i += lanes) {
    V value;
    std::memcpy(&value, x + i, Bytes);
    value = (value - largest) / temperature;
    exponential<Bytes>(value);
    std::memcpy(weights + i, &value, Bytes);
  }
  if (whole < count) {
    const size_t rest = static_cast<size_t>(count - whole) * sizeof(Scalar);
    V value = V{} + largest;
    std::memcpy(&value, x + whole, rest);
    value = (value - largest) / temperature;
    exponential<Bytes>(value);
    std::memcpy(weights + whole, &value, rest);
  }
}

template <class Scalar>
using Kernel = void (*)(const Scalar*, Eigen::Index, Scalar, Scalar, Scalar*);

template <class Scalar>
SUPPLE_AVX512 void avx512(const Scalar* x, Eigen::Index count, Scalar largest, Scalar temperature,
                          Scalar* weights) {
  body<64>(x, count, largest, temperature, weights);
}
template <class Scalar>
SUPPLE_AVX2 void avx2(const Scalar* x, Eigen::Index count, Scalar largest, Scalar temperature,
                      Scalar* weights) {
  body<32>(x, count, largest, temperature, weights);
}
template <class Scalar>
void plain(const Scalar* x, Eigen::Index count, Scalar largest, Scalar temperature,
           Scalar* weights) {
  body<16>(x, count, largest, temperature, weights);
}

}  // namespace

template <class Scalar>
void soft_weights(const Scalar* x, Eigen::Index count, Scalar largest, Scalar temperature,
                  Scalar* weights) {
  static const auto kernel =
      best_kernel<Kernel<Scalar>>(avx512<Scalar>, avx2<Scalar>, plain<Scalar>);
  kernel(x, count, largest, temperature, weights);
}

template void soft_weights(const float*, Eigen::Index, float, float, float*);
template void soft_weights(const double*, Eigen::Index, double, double, double*);

}  // namespace supple
