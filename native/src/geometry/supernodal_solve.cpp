// SPDX-License-Identifier: GPL-3.0-or-later
#include "supernodal_solve.h"

#include "supple/core/simd.h"

namespace supple {
namespace {

// Width right-hand sides: Width / lanes vectors.
template <int Width, int Bytes>
struct Row {
  using V = typename Lanes<double, Bytes>::type;
  static constexpr int kVectors = Width / Lanes<double, Bytes>::count;
  V part[kVectors];

  SUPPLE_INLINE void add(double factor, const Row& other) {
    for (int v = 0; v < kVectors; ++v) {
      part[v] += factor * other.part[v];
    }
  }
  SUPPLE_INLINE void take(double factor, const Row& other) {
    for (int v = 0; v < kVectors; ++v) {
      part[v] -= factor * other.part[v];
    }
  }
  SUPPLE_INLINE void take(const Row& other) {
    for (int v = 0; v < kVectors; ++v) {
      part[v] -= other.part[v];
    }
  }
  SUPPLE_INLINE void scale(double factor) {
    for (int v = 0; v < kVectors; ++v) {
      part[v] *= factor;
    }
  }
};

template <int Width, int Bytes>
SUPPLE_INLINE void forward(const SupernodalFactor& factor, double* panel) {
  using R = Row<Width, Bytes>;
  R* const x = reinterpret_cast<R*>(panel);
  for (int s = 0; s < factor.supernodes; ++s) {
    const int first = factor.super[s], columns = factor.super[s + 1] - first;
    const int* const rows = factor.rows + factor.row_start[s];
    const int height = factor.row_start[s + 1] - factor.row_start[s];
    const double* const block = factor.values + factor.value_start[s];
    const auto column = [&](int j) { return block + static_cast<std::ptrdiff_t>(j) * height; };
    R* const own = x + first;
    for (int j = 0; j < columns; ++j) {
      R value = own[j];
      value.scale(1.0 / column(j)[j]);
      own[j] = value;
      for (int i = j + 1; i < columns; ++i) {
        own[i].take(column(j)[i], value);
      }
    }
    int i = columns;
    for (; i + 4 <= height; i += 4) {
      R a = {}, b = {}, c = {}, d = {};
      for (int j = 0; j < columns; ++j) {
        const R value = own[j];
        const double* const entry = column(j) + i;
        a.add(entry[0], value);
        b.add(entry[1], value);
        c.add(entry[2], value);
        d.add(entry[3], value);
      }
      x[rows[i]].take(a);
      x[rows[i + 1]].take(b);
      x[rows[i + 2]].take(c);
      x[rows[i + 3]].take(d);
    }
    for (; i < height; ++i) {
      R a = {};
      for (int j = 0; j < columns; ++j) {
        a.add(column(j)[i], own[j]);
      }
      x[rows[i]].take(a);
    }
  }
}

template <int Width, int Bytes>
SUPPLE_INLINE void backward(const SupernodalFactor& factor, double* panel) {
  using R = Row<Width, Bytes>;
  R* const x = reinterpret_cast<R*>(panel);
  for (int s = factor.supernodes - 1; s >= 0; --s) {
    const int first = factor.super[s], columns = factor.super[s + 1] - first;
    const int* const rows = factor.rows + factor.row_start[s];
    const int height = factor.row_start[s + 1] - factor.row_start[s];
    const double* const block = factor.values + factor.value_start[s];
    const auto column = [&](int j) { return block + static_cast<std::ptrdiff_t>(j) * height; };
    R* const own = x + first;
    int j = 0;
    for (; j + 4 <= columns; j += 4) {
      R a = {}, b = {}, c = {}, d = {};
      const double *const la = column(j), *const lb = column(j + 1), *const lc = column(j + 2),
                          *const ld = column(j + 3);
      for (int i = columns; i < height; ++i) {
        const R value = x[rows[i]];
        a.add(la[i], value);
        b.add(lb[i], value);
        c.add(lc[i], value);
        d.add(ld[i], value);
      }
      own[j].take(a);
      own[j + 1].take(b);
      own[j + 2].take(c);
      own[j + 3].take(d);
    }
    for (; j < columns; ++j) {
      R a = {};
      for (int i = columns; i < height; ++i) {
        a.add(column(j)[i], x[rows[i]]);
      }
      own[j].take(a);
    }
    for (j = columns - 1; j >= 0; --j) {
      R value = own[j];
      for (int i = j + 1; i < columns; ++i) {
        value.take(column(j)[i], own[i]);
      }
      value.scale(1.0 / column(j)[j]);
      own[j] = value;
    }
  }
}

template <int Width, int Bytes>
SUPPLE_INLINE void solve(const SupernodalFactor& factor, double* panel, Substitution part) {
  if (part != Substitution::backward) {
    forward<Width, Bytes>(factor, panel);
  }
  if (part != Substitution::forward) {
    backward<Width, Bytes>(factor, panel);
  }
}

template <int Width>
struct Kernels {
  SUPPLE_AVX512 static void avx512(const SupernodalFactor& factor, double* panel,
                                   Substitution part) {
    solve<Width, (Width < 8 ? 32 : 64)>(factor, panel, part);
  }
  SUPPLE_AVX2 static void avx2(const SupernodalFactor& factor, double* panel, Substitution part) {
    solve<Width, 32>(factor, panel, part);
  }
  static void plain(const SupernodalFactor& factor, double* panel, Substitution part) {
    solve<Width, 16>(factor, panel, part);
  }
  static void best(const SupernodalFactor& factor, double* panel, Substitution part) {
    static const auto kernel = best_kernel(&avx512, &avx2, &plain);
    kernel(factor, panel, part);
  }
};

}  // namespace

void solve_panel(const SupernodalFactor& factor, double* panel, int width, Substitution part) {
  switch (width) {
    case 4:
      return Kernels<4>::best(factor, panel, part);
    case 8:
      return Kernels<8>::best(factor, panel, part);
    default:
      return Kernels<16>::best(factor, panel, part);
  }
}

}  // namespace supple
