// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/lane_math.h"

#include <cmath>

#include "native/support.h"

namespace supple {
namespace {

// Vectors of 16 bytes: every machine has them, and wider ones differ in nothing but their lanes.
constexpr int kBytes = 16;

template <class Scalar, int Steps>
Scalar root_of(Scalar x) {
  typename Lanes<Scalar, kBytes>::type in = {}, out = {};
  in += x;
  inverse_root<Scalar, kBytes, Steps>(in, out);
  return out[Lanes<Scalar, kBytes>::count - 1];
}

TEST(InverseRoot, AgainstTheLibrarysOverTheWholeRange) {
  for (int power = -280; power <= 280; ++power) {
    const double x = 1.37 * std::pow(10.0, power);
    EXPECT_NEAR((root_of<double, 4>(x)) * std::sqrt(x), 1.0, 4e-16) << x;
    EXPECT_NEAR((root_of<double, 1>(x)) * std::sqrt(x), 1.0, 2e-3) << x;
  }
  for (int power = -36; power <= 36; ++power) {
    const float x = 1.37F * std::pow(10.0F, static_cast<float>(power));
    EXPECT_NEAR((root_of<float, 3>(x)) * std::sqrt(x), 1.0F, 4e-7F) << x;
  }
}

TEST(InverseRoot, Of0IsFinite) {
  EXPECT_EQ((0.0 * root_of<double, 4>(0.0)), 0.0);
  EXPECT_EQ((0.0F * root_of<float, 1>(0.0F)), 0.0F);
}

template <class Scalar, int Bytes>
SUPPLE_INLINE void transpose(Scalar* numbers) {
  transpose_lanes<Scalar, Bytes>(reinterpret_cast<typename Lanes<Scalar, Bytes>::type*>(numbers));
}
template <class Scalar>
SUPPLE_AVX512 void transpose_avx512(Scalar* numbers) {
  transpose<Scalar, 64>(numbers);
}
template <class Scalar>
SUPPLE_AVX2 void transpose_avx2(Scalar* numbers) {
  transpose<Scalar, 32>(numbers);
}
template <class Scalar>
void transpose_plain(Scalar* numbers) {
  transpose<Scalar, 16>(numbers);
}

template <class Scalar>
void expect_transposed() {
  using Function = void (*)(Scalar*);
  const auto kernel = best_kernel<Function>(&transpose_avx512<Scalar>, &transpose_avx2<Scalar>,
                                            &transpose_plain<Scalar>);
  const int bytes = simd_level() == SimdLevel::avx512 ? 64
                    : simd_level() == SimdLevel::avx2 ? 32
                                                      : 16;
  const auto lanes = bytes / static_cast<int>(sizeof(Scalar));
  alignas(64) Scalar numbers[256];
  for (int i = 0; i < lanes * lanes; ++i) {
    numbers[i] = static_cast<Scalar>(i);
  }
  kernel(numbers);
  for (int row = 0; row < lanes; ++row) {
    for (int column = 0; column < lanes; ++column) {
      EXPECT_EQ(numbers[row * lanes + column], static_cast<Scalar>(column * lanes + row));
    }
  }
}

TEST(TransposeLanes, OfEachWidth) {
  test::at_every_simd_level([] {
    expect_transposed<float>();
    expect_transposed<double>();
  });
}

}  // namespace
}  // namespace supple
