// SPDX-License-Identifier: GPL-3.0-or-later
#include "combine_kernel.h"

#include <algorithm>

#include "core/lane_math.h"

namespace supple::equivariant {
namespace {

// Columns of coefficients whose sums stay in registers: 24 of the 32 that AVX-512 has, which is
// all there are of one field; 8 of 16 elsewhere.
constexpr Eigen::Index kTogether = 24;
template <int Bytes>
constexpr int kSums = Bytes == 64 ? 24 : 8;

constexpr Eigen::Index columns_for(int fields) {
  const Eigen::Index count = 9 * fields + output_count(fields);
  return (count + kTogether - 1) / kTogether * kTogether;
}
constexpr Eigen::Index kMostColumns = columns_for(kMaxFields);
// Functions taken together: of most contexts, all.
constexpr Eigen::Index kTile = scale_limit(kScaleCount - 1);

template <class Scalar>
struct Task {
  Layout layout;
  const Scalar* functions;  // n x stride
  Eigen::Index stride, n;
  Eigen::Index ends[kScaleCount];  // of each band of functions
  const Scalar* coefficients;      // k x columns
  Eigen::Index columns;
  const Scalar *reference, *defect;
  Combination<Scalar>* out;
};

template <class Scalar, int Bytes>
struct Block {
  using V = typename Lanes<Scalar, Bytes>::type;
  static constexpr int kLanes = Lanes<Scalar, Bytes>::count;

  V functions[kTile];                  // of as many vertices as lanes
  V bands[kScaleCount][kMostColumns];  // what each band of functions adds up to
  V along[kPadded], normal[kPadded];

  // Functions `tile` to tile + count - 1 of the vertices from `first` on; the last one again where
  // there are no more.
  SUPPLE_INLINE void load(const Task<Scalar>& task, Eigen::Index first, Eigen::Index tile,
                          Eigen::Index count) {
    Eigen::Index j = 0;
    for (; j + kLanes <= count; j += kLanes) {
      for (int l = 0; l < kLanes; ++l) {
        const Scalar* const from =
            task.functions + std::min(first + l, task.n - 1) * task.stride + tile + j;
        __builtin_memcpy(&functions[j + l], from, sizeof(V));
      }
      transpose_lanes<Scalar, Bytes>(functions + j);
    }
    for (; j < count; ++j) {
      for (int l = 0; l < kLanes; ++l) {
        functions[j][l] = task.functions[std::min(first + l, task.n - 1) * task.stride + tile + j];
      }
    }
  }

  // Adds what those functions add up to; the first ones set it.
  SUPPLE_INLINE void add(const Task<Scalar>& task, Eigen::Index tile, Eigen::Index count) {
    for (Eigen::Index column = 0; column < task.columns; column += kSums<Bytes>) {
      Eigen::Index j = 0;
      for (int s = 0; s < kScaleCount; ++s) {
        V sums[kSums<Bytes>] = {};
        const Eigen::Index end = std::min(task.ends[s] - tile, count);
        for (; j < end; ++j) {
          const V& value = functions[j];
          const Scalar* const c = task.coefficients + (tile + j) * task.columns + column;
#pragma GCC unroll 24
          for (int i = 0; i < kSums<Bytes>; ++i) {
            sums[i] += value * c[i];
          }
        }
#pragma GCC unroll 24
        for (int i = 0; i < kSums<Bytes>; ++i) {
          bands[s][column + i] = tile == 0 ? sums[i] : bands[s][column + i] + sums[i];
        }
      }
    }
  }

  SUPPLE_INLINE void expand(const Task<Scalar>& task, Eigen::Index first) {
    const Eigen::Index k = task.ends[kScaleCount - 1];
    Eigen::Index tile = 0;
    do {
      const Eigen::Index count = std::min(kTile, k - tile);
      load(task, first, tile, count);
      add(task, tile, count);
      tile += kTile;
    } while (tile < k);
  }

  SUPPLE_INLINE void combine(const Task<Scalar>& task) {
    const int fields = task.layout.fields;
    V c[kMostColumns] = {};
    for (Eigen::Index o = 9 * fields; o < task.columns; ++o) {
      for (int s = 0; s < kScaleCount; ++s) {
        c[o - 9 * fields] += bands[s][o];
      }
    }
    for (int e = 0; e < kPadded; ++e) {
      along[e] = normal[e] = V{};
    }
    V sum{}, normal_sum{};
    for (int i = 0; i < fields; ++i) {
      // sum_s c_s Y_s = sum over bands b of (sum_{s >= b} c_s) Z_b.
      V plain{}, across{};
      for (int s = kScaleCount - 1; s >= 0; --s) {
        plain += c[task.layout.smooth(i, s)];
        across += c[task.layout.smooth(i, s) + 1];
        for (int e = 0; e < 9; ++e) {
          along[e] += plain * bands[s][9 * i + e];
          normal[e] += across * bands[s][9 * i + e];
        }
      }
      sum += plain;
      normal_sum += across;
    }
    // Y Y^T - I = (C C^T - I) + (C e^T + e C^T) + e e^T: the middle is linear in e, so its sum is
    // that of the weighted e; only e e^T, symmetric, is summed scale by scale.
    V smooth[9] = {}, weighted[9] = {}, square[6] = {}, total{};
    for (int s = 0; s < kScaleCount; ++s) {
      const V d = c[task.layout.defect(s)];
      total += d;
      for (int e = 0; e < 9; ++e) {
        smooth[e] += bands[s][9 * (fields - 1) + e];
        weighted[e] += d * smooth[e];
      }
      for (int i = 0; i < 3; ++i) {
        for (int j = i; j < 3; ++j) {
          V dot{};
          for (int e = 0; e < 3; ++e) {
            dot += smooth[3 * i + e] * smooth[3 * j + e];
          }
          square[kSymmetric[3 * i + j]] += d * dot;
        }
      }
    }
    for (int i = 0; i < 3; ++i) {
      for (int j = i; j < 3; ++j) {
        V mixed{};
        for (int e = 0; e < 3; ++e) {
          mixed += task.reference[3 * i + e] * weighted[3 * j + e] +
                   weighted[3 * i + e] * task.reference[3 * j + e];
        }
        const int k = kSymmetric[3 * i + j];
        normal[kDefect + k] = total * task.defect[3 * i + j] + mixed + square[k];
      }
    }
    along[kSum] = sum;
    along[kNormalSum] = normal_sum;
    if (fields > 1) {
      along[kFirst] = c[task.layout.plain(0)];
      along[kNormalFirst] = c[task.layout.plain(0) + 1];
    }
  }

  SUPPLE_INLINE void store(const Task<Scalar>& task, Eigen::Index first, Eigen::Index count) {
    for (int part = 0; part < kPadded; part += kLanes) {
      transpose_lanes<Scalar, Bytes>(along + part);
      transpose_lanes<Scalar, Bytes>(normal + part);
      for (Eigen::Index l = 0; l < count; ++l) {
        Combination<Scalar>& out = task.out[first + l];
        __builtin_memcpy(out.along + part, &along[part + l], sizeof(V));
        __builtin_memcpy(out.normal + part, &normal[part + l], sizeof(V));
      }
    }
  }
};

template <class Scalar, int Bytes>
SUPPLE_INLINE void run(const Task<Scalar>& task, Eigen::Index first, Eigen::Index last) {
  using B = Block<Scalar, Bytes>;
  B block;
  for (; first < last; first += B::kLanes) {
    block.expand(task, first);
    block.combine(task);
    block.store(task, first, std::min<Eigen::Index>(B::kLanes, last - first));
  }
}

template <class Scalar>
struct Kernels {
  using Function = void (*)(const Task<Scalar>& task, Eigen::Index first, Eigen::Index last);
  SUPPLE_AVX512 static void avx512(const Task<Scalar>& task, Eigen::Index first,
                                   Eigen::Index last) {
    run<Scalar, 64>(task, first, last);
  }
  SUPPLE_AVX2 static void avx2(const Task<Scalar>& task, Eigen::Index first, Eigen::Index last) {
    run<Scalar, 32>(task, first, last);
  }
  static void plain(const Task<Scalar>& task, Eigen::Index first, Eigen::Index last) {
    run<Scalar, 16>(task, first, last);
  }
  static Function best() {
    static const Function kernel = best_kernel<Function>(&avx512, &avx2, &plain);
    return kernel;
  }
};

}  // namespace

template <class Scalar>
CombineKernel<Scalar>::CombineKernel(const NetworkContext<Scalar>& context,
                                     const Fields<Scalar>& fields, const RowMatrix<Scalar>& outputs)
    : context_(context), layout_{static_cast<int>(fields.coefficients.cols() / kPadded)} {
  coefficients_ = RowMatrix<Scalar>::Zero(outputs.rows(), columns_for(layout_.fields));
  for (int i = 0; i < layout_.fields; ++i) {
    coefficients_.middleCols(9 * i, 9) = fields.coefficients.middleCols(kPadded * i, 9);
  }
  coefficients_.middleCols(9 * layout_.fields, outputs.cols()) = outputs;
  const Matrix3 defect = fields.reference * fields.reference.transpose() - Matrix3::Identity();
  for (int e = 0; e < 9; ++e) {
    reference_[e] = static_cast<Scalar>(fields.reference.data()[e]);
    defect_[e] = static_cast<Scalar>(defect.data()[e]);
  }
}

template <class Scalar>
void CombineKernel<Scalar>::combine(Eigen::Index first, Eigen::Index last,
                                    Combination<Scalar>* out) const {
  Task<Scalar> task{layout_,
                    context_.functions.data(),
                    context_.functions.cols(),
                    context_.functions.rows(),
                    {},
                    coefficients_.data(),
                    coefficients_.cols(),
                    reference_,
                    defect_,
                    out};
  std::copy_n(context_.scales.begin(), kScaleCount, task.ends);
  Kernels<Scalar>::best()(task, first, last);
}

template class CombineKernel<float>;
template class CombineKernel<double>;

}  // namespace supple::equivariant
