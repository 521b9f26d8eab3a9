// SPDX-License-Identifier: GPL-3.0-or-later
#include "supernodal_solve.h"

#include <algorithm>
#include <iterator>

#include "supple/core/simd.h"

namespace supple {
namespace {

template <class Scalar>
SUPPLE_INLINE const Scalar* values_of(const SupernodalFactor& factor);
template <>
SUPPLE_INLINE const double* values_of(const SupernodalFactor& factor) {
  return factor.values;
}
template <>
SUPPLE_INLINE const float* values_of(const SupernodalFactor& factor) {
  return factor.single_values;
}

// Width right-hand sides: Width / lanes vectors.
template <class Scalar, int Width, int Bytes>
struct Row {
  using V = typename Lanes<Scalar, Bytes>::type;
  static constexpr int kVectors = Width / Lanes<Scalar, Bytes>::count;
  V part[kVectors];

  SUPPLE_INLINE void add(Scalar factor, const Row& other) {
    for (int v = 0; v < kVectors; ++v) {
      part[v] += factor * other.part[v];
    }
  }
  SUPPLE_INLINE void take(Scalar factor, const Row& other) {
    for (int v = 0; v < kVectors; ++v) {
      part[v] -= factor * other.part[v];
    }
  }
  SUPPLE_INLINE void take(const Row& other) {
    for (int v = 0; v < kVectors; ++v) {
      part[v] -= other.part[v];
    }
  }
  SUPPLE_INLINE void scale(Scalar factor) {
    for (int v = 0; v < kVectors; ++v) {
      part[v] *= factor;
    }
  }
};

template <class Scalar, int Width, int Bytes>
SUPPLE_INLINE void forward(const SupernodalFactor& factor, SupernodeRange range, Scalar* panel) {
  using R = Row<Scalar, Width, Bytes>;
  R* const x = reinterpret_cast<R*>(panel);
  for (int s = range.first; s < range.last; ++s) {
    const int first = factor.super[s], columns = factor.super[s + 1] - first;
    const int* const rows = factor.rows + factor.row_start[s];
    const int height = factor.row_start[s + 1] - factor.row_start[s];
    const Scalar* const block = values_of<Scalar>(factor) + factor.value_start[s];
    const auto column = [&](int j) { return block + static_cast<std::ptrdiff_t>(j) * height; };
    R* const own = x + first;
    for (int j = 0; j < columns; ++j) {
      R value = own[j];
      value.scale(Scalar(1) / column(j)[j]);
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
        const Scalar* const entry = column(j) + i;
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

template <class Scalar, int Width, int Bytes>
SUPPLE_INLINE void backward(const SupernodalFactor& factor, SupernodeRange range, Scalar* panel) {
  using R = Row<Scalar, Width, Bytes>;
  R* const x = reinterpret_cast<R*>(panel);
  for (int s = range.last - 1; s >= range.first; --s) {
    const int first = factor.super[s], columns = factor.super[s + 1] - first;
    const int* const rows = factor.rows + factor.row_start[s];
    const int height = factor.row_start[s + 1] - factor.row_start[s];
    const Scalar* const block = values_of<Scalar>(factor) + factor.value_start[s];
    const auto column = [&](int j) { return block + static_cast<std::ptrdiff_t>(j) * height; };
    R* const own = x + first;
    int j = 0;
    for (; j + 4 <= columns; j += 4) {
      R a = {}, b = {}, c = {}, d = {};
      const Scalar *const la = column(j), *const lb = column(j + 1), *const lc = column(j + 2),
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
      value.scale(Scalar(1) / column(j)[j]);
      own[j] = value;
    }
  }
}

template <class Scalar, int Width>
struct Kernels {
  using Function = void (*)(const SupernodalFactor&, SupernodeRange, Scalar*);
  // No wider than a row of the panel.
  static constexpr int fitting(int bytes) {
    return std::min(bytes, Width * static_cast<int>(sizeof(Scalar)));
  }
  SUPPLE_AVX512 static void forward_avx512(const SupernodalFactor& factor, SupernodeRange range,
                                           Scalar* panel) {
    forward<Scalar, Width, fitting(64)>(factor, range, panel);
  }
  SUPPLE_AVX2 static void forward_avx2(const SupernodalFactor& factor, SupernodeRange range,
                                       Scalar* panel) {
    forward<Scalar, Width, fitting(32)>(factor, range, panel);
  }
  static void forward_plain(const SupernodalFactor& factor, SupernodeRange range, Scalar* panel) {
    forward<Scalar, Width, 16>(factor, range, panel);
  }
  SUPPLE_AVX512 static void backward_avx512(const SupernodalFactor& factor, SupernodeRange range,
                                            Scalar* panel) {
    backward<Scalar, Width, fitting(64)>(factor, range, panel);
  }
  SUPPLE_AVX2 static void backward_avx2(const SupernodalFactor& factor, SupernodeRange range,
                                        Scalar* panel) {
    backward<Scalar, Width, fitting(32)>(factor, range, panel);
  }
  static void backward_plain(const SupernodalFactor& factor, SupernodeRange range, Scalar* panel) {
    backward<Scalar, Width, 16>(factor, range, panel);
  }
  static Function best_forward() {
    static const Function kernel =
        best_kernel<Function>(&forward_avx512, &forward_avx2, &forward_plain);
    return kernel;
  }
  static Function best_backward() {
    static const Function kernel =
        best_kernel<Function>(&backward_avx512, &backward_avx2, &backward_plain);
    return kernel;
  }
};

}  // namespace

template <class Scalar>
void forward_panel(const SupernodalFactor& factor, SupernodeRange range, Scalar* panel, int width) {
  const auto kernel = width == 4   ? Kernels<Scalar, 4>::best_forward()
                      : width == 8 ? Kernels<Scalar, 8>::best_forward()
                                   : Kernels<Scalar, 16>::best_forward();
  kernel(factor, range, panel);
}

template <class Scalar>
void backward_panel(const SupernodalFactor& factor, SupernodeRange range, Scalar* panel,
                    int width) {
  const auto kernel = width == 4   ? Kernels<Scalar, 4>::best_backward()
                      : width == 8 ? Kernels<Scalar, 8>::best_backward()
                                   : Kernels<Scalar, 16>::best_backward();
  kernel(factor, range, panel);
}

template void forward_panel(const SupernodalFactor&, SupernodeRange, double*, int);
template void forward_panel(const SupernodalFactor&, SupernodeRange, float*, int);
template void backward_panel(const SupernodalFactor&, SupernodeRange, double*, int);
template void backward_panel(const SupernodalFactor&, SupernodeRange, float*, int);

SupernodeParts supernode_parts(const SupernodalFactor& factor, int rows) {
  // Below so many entries a solve takes less time than it takes to wake a thread.
  constexpr double kSmall = 100'000.0;
  // A subtree goes to one part; with all of them below this share the parts come out even.
  constexpr double kLargest = 0.12;
  const int count = factor.supernodes;
  std::vector<int> owner(static_cast<size_t>(rows));  // supernode of each row
  for (int s = 0; s < count; ++s) {
    for (int r = factor.super[s]; r < factor.super[s + 1]; ++r) {
      owner[static_cast<size_t>(r)] = s;
    }
  }
  // Supernodes are in postorder: a subtree is the range from its first descendant to its root.
  std::vector<int> parent(static_cast<size_t>(count), -1), first(static_cast<size_t>(count));
  std::vector<double> work(static_cast<size_t>(count));
  for (int s = 0; s < count; ++s) {
    first[static_cast<size_t>(s)] = s;
  }
  double total = 0.0;
  for (int s = 0; s < count; ++s) {
    const auto here = static_cast<size_t>(s);
    const int columns = factor.super[s + 1] - factor.super[s];
    const int height = factor.row_start[s + 1] - factor.row_start[s];
    const double own = static_cast<double>(columns) * height;
    work[here] += own;
    total += own;
    if (height > columns) {
      const int up = owner[static_cast<size_t>(factor.rows[factor.row_start[s] + columns])];
      parent[here] = up;
      work[static_cast<size_t>(up)] += work[here];
      first[static_cast<size_t>(up)] = std::min(first[static_cast<size_t>(up)], first[here]);
    }
  }
  SupernodeParts result;
  if (total < kSmall) {
    result.top.push_back({0, count});
    return result;
  }
  std::vector<int> subtrees;
  for (int s = count - 1; s >= 0; --s) {
    const auto here = static_cast<size_t>(s);
    const bool light = work[here] <= kLargest * total;
    const bool under_top =
        parent[here] < 0 || work[static_cast<size_t>(parent[here])] > kLargest * total;
    if (!light) {
      result.top.push_back({s, s + 1});
    } else if (under_top) {
      subtrees.push_back(s);
    }
  }
  std::reverse(result.top.begin(), result.top.end());
  for (const SupernodeRange& range : result.top) {
    for (int r = factor.super[range.first]; r < factor.super[range.last]; ++r) {
      result.top_rows.push_back(r);
    }
  }
  // The heaviest first, each to the part that has least.
  std::stable_sort(subtrees.begin(), subtrees.end(), [&](int a, int b) {
    return work[static_cast<size_t>(a)] > work[static_cast<size_t>(b)];
  });
  double load[SupernodeParts::kParts] = {};
  for (const int s : subtrees) {
    const auto least = std::min_element(std::begin(load), std::end(load)) - std::begin(load);
    load[least] += work[static_cast<size_t>(s)];
    result.parts[least].push_back({first[static_cast<size_t>(s)], s + 1});
  }
  for (auto& part : result.parts) {
    std::sort(part.begin(), part.end(),
              [](const SupernodeRange& a, const SupernodeRange& b) { return a.first < b.first; });
  }
  return result;
}

}  // namespace supple
