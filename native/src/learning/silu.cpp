// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/silu.h"

#include <cmath>
#include <cstring>

#include "exponential.h"
#include "supple/core/simd.h"

namespace supple {
namespace {

// Calls step(i, bytes) for each vector of a row; all bytes of one but at the end.
template <int Bytes, class Step>
SUPPLE_INLINE void over_row(Eigen::Index count, const Step& step) {
  constexpr Eigen::Index lanes = Lanes<float, Bytes>::count;
  Eigen::Index i = 0;
  for (; i + lanes <= count; i += lanes) {
    step(i, Bytes);
  }
  if (i < count) {
    step(i, static_cast<int>((count - i) * static_cast<Eigen::Index>(sizeof(float))));
  }
}

template <class V>
SUPPLE_INLINE void load(V& vector, const float* from, int bytes) {
  std::memcpy(&vector, from, static_cast<size_t>(bytes));
}
template <class V>
SUPPLE_INLINE void store(const V& vector, float* to, int bytes) {
  std::memcpy(to, &vector, static_cast<size_t>(bytes));
}

template <int Bytes>
SUPPLE_INLINE void forward_row(const float* bias, float* x, float* y, Eigen::Index count) {
  using V = typename Lanes<float, Bytes>::type;
  over_row<Bytes>(
      count, [&](Eigen::Index i, int bytes) __attribute__((always_inline)) {
        V value = {}, b = {};
        load(value, x + i, bytes);
        load(b, bias + i, bytes);
        value += b;
        V power = -value;
        exponential<Bytes>(power);
        const V result = value / (1.0f + power);
        store(value, x + i, bytes);
        store(result, y + i, bytes);
      });
}

template <int Bytes>
SUPPLE_INLINE void backward_row(const float* x, const float* grad, float* out, Eigen::Index count) {
  using V = typename Lanes<float, Bytes>::type;
  over_row<Bytes>(
      count, [&](Eigen::Index i, int bytes) __attribute__((always_inline)) {
        V value = {}, g = {};
        load(value, x + i, bytes);
        load(g, grad + i, bytes);
        V power = -value;
        exponential<Bytes>(power);
        const V sigmoid = 1.0f / (1.0f + power);
        const V result = g * sigmoid * (1.0f + value * (1.0f - sigmoid));
        store(result, out + i, bytes);
      });
}

using RowForward = void (*)(const float*, float*, float*, Eigen::Index);
using RowBackward = void (*)(const float*, const float*, float*, Eigen::Index);

SUPPLE_AVX512 void forward_avx512(const float* bias, float* x, float* y, Eigen::Index count) {
  forward_row<64>(bias, x, y, count);
}
SUPPLE_AVX2 void forward_avx2(const float* bias, float* x, float* y, Eigen::Index count) {
  forward_row<32>(bias, x, y, count);
}
void forward_plain(const float* bias, float* x, float* y, Eigen::Index count) {
  forward_row<16>(bias, x, y, count);
}
SUPPLE_AVX512 void backward_avx512(const float* x, const float* grad, float* out,
                                   Eigen::Index count) {
  backward_row<64>(x, grad, out, count);
}
SUPPLE_AVX2 void backward_avx2(const float* x, const float* grad, float* out, Eigen::Index count) {
  backward_row<32>(x, grad, out, count);
}
void backward_plain(const float* x, const float* grad, float* out, Eigen::Index count) {
  backward_row<16>(x, grad, out, count);
}

void forward(const float* bias, float* x, float* y, Eigen::Index count) {
  static const RowForward kernel =
      best_kernel<RowForward>(forward_avx512, forward_avx2, forward_plain);
  kernel(bias, x, y, count);
}
void backward(const float* x, const float* grad, float* out, Eigen::Index count) {
  static const RowBackward kernel =
      best_kernel<RowBackward>(backward_avx512, backward_avx2, backward_plain);
  kernel(x, grad, out, count);
}

// Double is for checking derivatives.
void forward(const double* bias, double* x, double* y, Eigen::Index count) {
  for (Eigen::Index i = 0; i < count; ++i) {
    x[i] += bias[i];
    y[i] = x[i] / (1.0 + std::exp(-x[i]));
  }
}
void backward(const double* x, const double* grad, double* out, Eigen::Index count) {
  for (Eigen::Index i = 0; i < count; ++i) {
    const double sigmoid = 1.0 / (1.0 + std::exp(-x[i]));
    out[i] = grad[i] * sigmoid * (1.0 + x[i] * (1.0 - sigmoid));
  }
}

}  // namespace

template <class Scalar>
RowMatrix<Scalar> add_bias_and_silu(const Eigen::Matrix<Scalar, 1, Eigen::Dynamic>& bias,
                                    RowMatrix<Scalar>& hidden) {
  RowMatrix<Scalar> result(hidden.rows(), hidden.cols());
#pragma omp parallel for schedule(static)
  for (Eigen::Index i = 0; i < hidden.rows(); ++i) {
    forward(bias.data(), hidden.row(i).data(), result.row(i).data(), hidden.cols());
  }
  return result;
}

template <class Scalar>
RowMatrix<Scalar> silu_backward(const RowMatrix<Scalar>& x, const RowMatrix<Scalar>& grad) {
  RowMatrix<Scalar> result(x.rows(), x.cols());
#pragma omp parallel for schedule(static)
  for (Eigen::Index i = 0; i < x.rows(); ++i) {
    backward(x.row(i).data(), grad.row(i).data(), result.row(i).data(), x.cols());
  }
  return result;
}

template RowMatrix<float> add_bias_and_silu(const Eigen::Matrix<float, 1, Eigen::Dynamic>&,
                                            RowMatrix<float>&);
template RowMatrix<double> add_bias_and_silu(const Eigen::Matrix<double, 1, Eigen::Dynamic>&,
                                             RowMatrix<double>&);
template RowMatrix<float> silu_backward(const RowMatrix<float>&, const RowMatrix<float>&);
template RowMatrix<double> silu_backward(const RowMatrix<double>&, const RowMatrix<double>&);

}  // namespace supple
