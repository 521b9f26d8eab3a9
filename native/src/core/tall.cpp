// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/core/tall.h"

#include <omp.h>

#include <algorithm>
#include <cstring>
#include <string>
#include <vector>

#include "supple/core/error.h"
#include "supple/core/simd.h"

namespace supple {
namespace {

// Columns of B packed together, at most: two AVX-512 registers.
template <class Scalar>
constexpr Eigen::Index kWidth = 128 / sizeof(Scalar);
// Rows whose part of B stays in the first-level cache while all columns of A are run through.
constexpr Eigen::Index kTileRows = 128;

// Part of a packed row: Vectors registers.
template <class V, int Vectors>
struct Part {
  V v[Vectors];
};
template <class V, int Vectors, class Scalar>
SUPPLE_INLINE Part<V, Vectors> load(const Scalar* from) {
  Part<V, Vectors> part;
#pragma GCC unroll 2
  for (int i = 0; i < Vectors; ++i) {
    part.v[i] = reinterpret_cast<const V*>(from)[i];
  }
  return part;
}
template <class V, int Vectors, class Scalar>
SUPPLE_INLINE void store(const Part<V, Vectors>& part, Scalar* to) {
#pragma GCC unroll 2
  for (int i = 0; i < Vectors; ++i) {
    reinterpret_cast<V*>(to)[i] = part.v[i];
  }
}
template <class V, int Vectors, class Scalar>
SUPPLE_INLINE void add(Part<V, Vectors>& sum, Scalar factor, const Part<V, Vectors>& value) {
#pragma GCC unroll 2
  for (int i = 0; i < Vectors; ++i) {
    sum.v[i] += factor * value.v[i];
  }
}

// sums (k x Width) += A^T B over `rows` rows; b is padded to Width columns. Together columns of A
// share each row of b that is read.
template <int Bytes, int Width, int Vectors, int Together, class Scalar>
SUPPLE_INLINE void transpose_columns(const Scalar* a, Eigen::Index a_stride, const Scalar* b,
                                     Eigen::Index rows, Scalar* sums) {
  using V = typename Lanes<Scalar, Bytes>::type;
  Part<V, Vectors> s[Together] = {};  // added at the end: sums of sums round less
  for (Eigen::Index i = 0; i < rows; ++i, a += a_stride, b += Width) {
    const auto value = load<V, Vectors>(b);
#pragma GCC unroll 16
    for (int t = 0; t < Together; ++t) {
      add(s[t], a[t], value);
    }
  }
#pragma GCC unroll 16
  for (int t = 0; t < Together; ++t) {
    add(s[t], Scalar(1), load<V, Vectors>(sums + t * Width));
    store(s[t], sums + t * Width);
  }
}

// product (rows x Width) += A C; c is padded to Width columns. Together rows of A share each row of
// c that is read.
template <int Bytes, int Width, int Vectors, int Together, class Scalar>
SUPPLE_INLINE void product_rows(const Scalar* a, Eigen::Index a_stride, Eigen::Index k,
                                const Scalar* c, Scalar* product) {
  using V = typename Lanes<Scalar, Bytes>::type;
  Part<V, Vectors> s[Together];
#pragma GCC unroll 16
  for (int t = 0; t < Together; ++t) {
    s[t] = load<V, Vectors>(product + t * Width);
  }
  for (Eigen::Index j = 0; j < k; ++j, c += Width) {
    const auto value = load<V, Vectors>(c);
#pragma GCC unroll 16
    for (int t = 0; t < Together; ++t) {
      add(s[t], a[t * a_stride + j], value);
    }
  }
#pragma GCC unroll 16
  for (int t = 0; t < Together; ++t) {
    store(s[t], product + t * Width);
  }
}

// Registers of sums at once: 16 of the 32 that AVX-512 has, 8 of 16 elsewhere.
template <int Bytes, int Vectors>
constexpr int kTogether = (Bytes == 64 ? 16 : 8) / Vectors;

template <int Bytes, int Width, class Scalar>
struct Shape {
  static constexpr int vectors = Width >= 2 * Lanes<Scalar, Bytes>::count ? 2 : 1;
  static constexpr int columns = vectors * Lanes<Scalar, Bytes>::count;
  static constexpr int together = kTogether<Bytes, vectors>;
};

template <int Bytes, int Width, class Scalar>
SUPPLE_INLINE void transpose_product_body(const Scalar* a, Eigen::Index a_stride, Eigen::Index k,
                                          const Scalar* b, Eigen::Index rows, Scalar* sums) {
  using S = Shape<Bytes, Width, Scalar>;
  for (int part = 0; part < Width; part += S::columns) {
    Eigen::Index j = 0;
    for (; j + S::together <= k; j += S::together) {
      transpose_columns<Bytes, Width, S::vectors, S::together>(a + j, a_stride, b + part, rows,
                                                               sums + j * Width + part);
    }
    // A piece may be narrower than that; one column after the other, each sum waits for itself.
    constexpr int kFewer = S::together / 2;
    for (; j + kFewer <= k; j += kFewer) {
      transpose_columns<Bytes, Width, S::vectors, kFewer>(a + j, a_stride, b + part, rows,
                                                          sums + j * Width + part);
    }
    for (; j < k; ++j) {
      transpose_columns<Bytes, Width, S::vectors, 1>(a + j, a_stride, b + part, rows,
                                                     sums + j * Width + part);
    }
  }
}

template <int Bytes, int Width, class Scalar>
SUPPLE_INLINE void product_body(const Scalar* a, Eigen::Index a_stride, Eigen::Index k,
                                const Scalar* c, Eigen::Index rows, Scalar* product) {
  using S = Shape<Bytes, Width, Scalar>;
  for (int part = 0; part < Width; part += S::columns) {
    Eigen::Index i = 0;
    for (; i + S::together <= rows; i += S::together) {
      product_rows<Bytes, Width, S::vectors, S::together>(a + i * a_stride, a_stride, k, c + part,
                                                          product + i * Width + part);
    }
    for (; i < rows; ++i) {
      product_rows<Bytes, Width, S::vectors, 1>(a + i * a_stride, a_stride, k, c + part,
                                                product + i * Width + part);
    }
  }
}

template <class Scalar>
using TallKernel = void (*)(const Scalar* a, Eigen::Index a_stride, Eigen::Index k, const Scalar* b,
                            Eigen::Index rows, Scalar* out);

template <class Scalar, int Width>
struct Kernels {
  SUPPLE_AVX512 static void transpose_avx512(const Scalar* a, Eigen::Index stride, Eigen::Index k,
                                             const Scalar* b, Eigen::Index rows, Scalar* out) {
    transpose_product_body<64, Width>(a, stride, k, b, rows, out);
  }
  SUPPLE_AVX2 static void transpose_avx2(const Scalar* a, Eigen::Index stride, Eigen::Index k,
                                         const Scalar* b, Eigen::Index rows, Scalar* out) {
    transpose_product_body<32, Width>(a, stride, k, b, rows, out);
  }
  static void transpose_plain(const Scalar* a, Eigen::Index stride, Eigen::Index k, const Scalar* b,
                              Eigen::Index rows, Scalar* out) {
    transpose_product_body<16, Width>(a, stride, k, b, rows, out);
  }
  SUPPLE_AVX512 static void product_avx512(const Scalar* a, Eigen::Index stride, Eigen::Index k,
                                           const Scalar* c, Eigen::Index rows, Scalar* out) {
    product_body<64, Width>(a, stride, k, c, rows, out);
  }
  SUPPLE_AVX2 static void product_avx2(const Scalar* a, Eigen::Index stride, Eigen::Index k,
                                       const Scalar* c, Eigen::Index rows, Scalar* out) {
    product_body<32, Width>(a, stride, k, c, rows, out);
  }
  static void product_plain(const Scalar* a, Eigen::Index stride, Eigen::Index k, const Scalar* c,
                            Eigen::Index rows, Scalar* out) {
    product_body<16, Width>(a, stride, k, c, rows, out);
  }
  static TallKernel<Scalar> transpose() {
    return best_kernel<TallKernel<Scalar>>(transpose_avx512, transpose_avx2, transpose_plain);
  }
  static TallKernel<Scalar> product() {
    return best_kernel<TallKernel<Scalar>>(product_avx512, product_avx2, product_plain);
  }
};

// Columns packed together for a matrix of so many: half as many where they do.
template <class Scalar>
Eigen::Index packed_width(Eigen::Index columns) {
  return columns <= kWidth<Scalar> / 2 ? kWidth<Scalar> / 2 : kWidth<Scalar>;
}
template <class Scalar>
constexpr int kHalf = static_cast<int>(kWidth<Scalar> / 2);
template <class Scalar>
constexpr int kWhole = static_cast<int>(kWidth<Scalar>);

// An array aligned for the kernels, zero.
template <class Scalar>
class Aligned {
 public:
  explicit Aligned(Eigen::Index count)
      : values_(static_cast<size_t>(count) / kWidth<Scalar> + 1, Line{}) {}
  Scalar* data() { return values_.front().numbers; }

 private:
  struct alignas(128) Line {
    Scalar numbers[kWidth<Scalar>];
  };
  std::vector<Line> values_;
};

// Columns first..first+count of a matrix, side by side and padded with zeros.
template <class Scalar>
void pack(const Scalar* from, Eigen::Index stride, Eigen::Index rows, Eigen::Index first,
          Eigen::Index count, Eigen::Index width, Scalar* to) {
  for (Eigen::Index i = 0; i < rows; ++i) {
    Scalar* const row = to + i * width;
    std::memcpy(row, from + i * stride + first, static_cast<size_t>(count) * sizeof(Scalar));
    std::fill(row + count, row + width, Scalar(0));
  }
}

// The rows are always shared out into as many parts, so that no sum depends on the number of
// threads.
constexpr Eigen::Index kMostParts = 16;

int parts_of(Eigen::Index rows) {
  const Eigen::Index tiles = (rows + kTileRows - 1) / kTileRows;
  return static_cast<int>(std::clamp<Eigen::Index>(tiles / 2, 1, kMostParts));
}

int threads_for(int parts) {
  return omp_in_parallel() ? 1 : std::min(parts, omp_get_max_threads());
}

void check(bool fits, const char* what) {
  if (!fits) {
    throw Error(ErrorCode::wrong_shape, std::string(what) + ": the shapes do not fit.");
  }
}

template <class Scalar>
Eigen::Index columns_of(const TallPieces<Scalar>& pieces, Eigen::Index rows, const char* what) {
  Eigen::Index columns = 0;
  for (const auto& piece : pieces) {
    check(piece.rows() == rows, what);
    columns += piece.cols();
  }
  return columns;
}

}  // namespace

template <class Scalar>
RowMatrix<Scalar> tall_product(const TallPieces<Scalar>& a, const ConstTallBlock<Scalar>& b) {
  const Eigen::Index width = packed_width<Scalar>(b.cols());
  const Eigen::Index n = b.rows(), k = columns_of(a, n, "tall_product"),
                     groups = (b.cols() + width - 1) / width;
  const int parts = parts_of(n), threads = threads_for(parts);
  const TallKernel<Scalar> transpose_product = width == kWhole<Scalar>
                                                   ? Kernels<Scalar, kWhole<Scalar>>::transpose()
                                                   : Kernels<Scalar, kHalf<Scalar>>::transpose();
  std::vector<Aligned<Scalar>> sums, packed;
  for (int part = 0; part < parts; ++part) {
    sums.emplace_back(groups * k * width);
    packed.emplace_back(kTileRows * width);
  }
#pragma omp parallel for schedule(static) num_threads(threads) if (threads > 1)
  for (int part = 0; part < parts; ++part) {
    Scalar* const right = packed[static_cast<size_t>(part)].data();
    const Eigen::Index last = n * (part + 1) / parts;
    for (Eigen::Index i = n * part / parts; i < last; i += kTileRows) {
      const Eigen::Index rows = std::min(kTileRows, last - i);
      Scalar* sum = sums[static_cast<size_t>(part)].data();
      for (Eigen::Index g = 0; g < groups; ++g) {
        pack(b.data() + i * b.outerStride(), b.outerStride(), rows, g * width,
             std::min(width, b.cols() - g * width), width, right);
        for (const auto& piece : a) {
          transpose_product(piece.data() + i * piece.outerStride(), piece.outerStride(),
                            piece.cols(), right, rows, sum);
          sum += piece.cols() * width;
        }
      }
    }
  }
  RowMatrix<Scalar> result = RowMatrix<Scalar>::Zero(k, b.cols());
  for (Aligned<Scalar>& sum : sums) {
    for (Eigen::Index g = 0; g < groups; ++g) {
      const Eigen::Index count = std::min(width, b.cols() - g * width);
      result.middleCols(g * width, count) +=
          Eigen::Map<const RowMatrix<Scalar>>(sum.data() + g * k * width, k, width).leftCols(count);
    }
  }
  return result;
}

template <class Scalar>
void add_tall_product(Scalar alpha, const TallPieces<Scalar>& a, const RowMatrix<Scalar>& c,
                      TallBlock<Scalar> b) {
  const Eigen::Index width = packed_width<Scalar>(c.cols());
  const Eigen::Index n = b.rows(), k = columns_of(a, n, "add_tall_product"),
                     groups = (c.cols() + width - 1) / width;
  check(c.rows() == k && c.cols() == b.cols(), "add_tall_product");
  const int parts = parts_of(n), threads = threads_for(parts);
  const TallKernel<Scalar> tile_product = width == kWhole<Scalar>
                                              ? Kernels<Scalar, kWhole<Scalar>>::product()
                                              : Kernels<Scalar, kHalf<Scalar>>::product();
  Aligned<Scalar> right(groups * k * width);
  const RowMatrix<Scalar> scaled = alpha * c;
  for (Eigen::Index g = 0; g < groups; ++g) {
    pack(scaled.data(), c.cols(), k, g * width, std::min(width, c.cols() - g * width), width,
         right.data() + g * k * width);
  }
  std::vector<Aligned<Scalar>> products(static_cast<size_t>(parts),
                                        Aligned<Scalar>(kTileRows * width));
#pragma omp parallel for schedule(static) num_threads(threads) if (threads > 1)
  for (int part = 0; part < parts; ++part) {
    Scalar* const product = products[static_cast<size_t>(part)].data();
    const Eigen::Index last = n * (part + 1) / parts;
    for (Eigen::Index i = n * part / parts; i < last; i += kTileRows) {
      const Eigen::Index rows = std::min(kTileRows, last - i);
      const Scalar* factor = right.data();
      for (Eigen::Index g = 0; g < groups; ++g) {
        const Eigen::Index count = std::min(width, c.cols() - g * width);
        std::fill(product, product + rows * width, Scalar(0));
        for (const auto& piece : a) {
          tile_product(piece.data() + i * piece.outerStride(), piece.outerStride(), piece.cols(),
                       factor, rows, product);
          factor += piece.cols() * width;
        }
        b.block(i, g * width, rows, count) +=
            Eigen::Map<const RowMatrix<Scalar>>(product, rows, width).leftCols(count);
      }
    }
  }
}

template RowMatrix<float> tall_product(const TallPieces<float>&, const ConstTallBlock<float>&);
template RowMatrix<double> tall_product(const TallPieces<double>&, const ConstTallBlock<double>&);
template void add_tall_product(float, const TallPieces<float>&, const RowMatrix<float>&,
                               TallBlock<float>);
template void add_tall_product(double, const TallPieces<double>&, const RowMatrix<double>&,
                               TallBlock<double>);

}  // namespace supple
