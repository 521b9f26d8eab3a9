// SPDX-License-Identifier: GPL-3.0-or-later
#include "round_kernels.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/lane_math.h"
#include "core/prefetch.h"
#include "geometry/rotation_lanes.h"
#include "supple/geometry/jacobians.h"

namespace supple {
namespace {

// Rotations come in single precision; what differs no more than their rounding counts as reached,
// so that a rigid motion stays one exactly.
constexpr double kRounding = 1e-6;

// Vectors of single precision have half the bytes of those of double, and so as many lanes.
template <int Bytes>
constexpr int kSingle = Bytes > 16 ? Bytes / 2 : 16;

// A block's lanes, as many at a time as a vector has.
template <int Bytes>
struct Doubles {
  using V = typename Lanes<double, Bytes>::type;
  static constexpr int kCount = Lanes<double, Bytes>::count;
  static SUPPLE_INLINE const V& at(const double* numbers, int lane) {
    return *reinterpret_cast<const V*>(numbers + lane);
  }
  static SUPPLE_INLINE V& at(double* numbers, int lane) {
    return *reinterpret_cast<V*>(numbers + lane);
  }
};

// out = A B, or A^T B.
template <int Bytes, bool Transposed>
SUPPLE_INLINE void multiply(const MatrixBlock& a, const MatrixBlock& b, MatrixBlock& out) {
  using D = Doubles<Bytes>;
  for (int l = 0; l < kBlock; l += D::kCount) {
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        typename D::V sum{};
        for (int k = 0; k < 3; ++k) {
          sum += D::at(a.e[Transposed ? 3 * k + i : 3 * i + k], l) * D::at(b.e[3 * k + j], l);
        }
        D::at(out.e[3 * i + j], l) = sum;
      }
    }
  }
}

// J = E1^-1 E2 of the moved faces.
template <int Bytes>
SUPPLE_INLINE void moved_jacobians(const RoundTask& task, Eigen::Index block, MatrixBlock& out) {
  using D = Doubles<Bytes>;
  const Faces& faces = task.faces->operators.faces;
  const Eigen::Index m = faces.rows(), first = kBlock * block;
  MatrixBlock frame;
  for (Eigen::Index i = 0; i < kBlock; ++i) {
    const Eigen::Index f = std::min(first + i, m - 1);
    if (f + kAhead < m) {
      for (int c = 0; c < 3; ++c) {
        prefetch(task.moved + 3 * faces(f + kAhead, c), 3 * sizeof(double));
      }
    }
    const double* const a = task.moved + 3 * faces(f, 0);
    const double* const b = task.moved + 3 * faces(f, 1);
    const double* const c = task.moved + 3 * faces(f, 2);
    for (int j = 0; j < 3; ++j) {
      frame.e[j][i] = b[j] - a[j];
      frame.e[3 + j][i] = c[j] - a[j];
    }
  }
  for (int l = 0; l < kBlock; l += D::kCount) {
    typename D::V cross[3], square{};
    for (int j = 0; j < 3; ++j) {
      const int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      cross[j] = D::at(frame.e[j1], l) * D::at(frame.e[3 + j2], l) -
                 D::at(frame.e[j2], l) * D::at(frame.e[3 + j1], l);
      square += cross[j] * cross[j];
    }
    typename D::V inverse;
    inverse_root<double, Bytes, 4>(square, inverse);
    for (int j = 0; j < 3; ++j) {
      D::at(frame.e[6 + j], l) = cross[j] * inverse;
    }
  }
  multiply<Bytes, false>(task.faces->inverse_frames[static_cast<size_t>(block)], frame, out);
}

// W R. R = (R_q^2)^2, where R_q turns by a quarter of the angle: for as little as that, the series
// of sin(x)/x and (1 - cos x)/x^2 need few terms.
template <int Bytes>
SUPPLE_INLINE void turn(const RoundTask& task, Eigen::Index block, MatrixBlock& out) {
  using D = Doubles<Bytes>;
  const Faces& faces = task.faces->operators.faces;
  alignas(64) double vector[3][kBlock];
  for (Eigen::Index i = 0; i < kBlock; ++i) {
    const Eigen::Index f = std::min(kBlock * block + i, faces.rows() - 1);
    for (int j = 0; j < 3; ++j) {
      vector[j][i] = (task.vectors[3 * faces(f, 0) + j] + task.vectors[3 * faces(f, 1) + j] +
                      task.vectors[3 * faces(f, 2) + j]) *
                     (0.25 / 3.0);
    }
    // Interpolation may lead to many turns: only what is left of the last one counts.
    const double square =
        vector[0][i] * vector[0][i] + vector[1][i] * vector[1][i] + vector[2][i] * vector[2][i];
    constexpr double kWhole = 0.5 * std::numbers::pi;  // a quarter of a whole turn
    if (square > kWhole * kWhole) {
      const double angle = std::sqrt(square);
      const double left = std::remainder(angle, kWhole) / angle;
      for (int j = 0; j < 3; ++j) {
        vector[j][i] *= left;
      }
    }
  }
  MatrixBlock quarter, half;
  for (int l = 0; l < kBlock; l += D::kCount) {
    const typename D::V &x = D::at(vector[0], l), &y = D::at(vector[1], l),
                        &z = D::at(vector[2], l);
    const typename D::V square = x * x + y * y + z * z;
    constexpr int kTerms = 12;  // of double precision up to a whole turn, four times this angle
    typename D::V s{}, c{};
    for (int k = kTerms - 1; k >= 0; --k) {
      s = 1.0 - s * square * (1.0 / ((2 * k + 2) * (2 * k + 3)));
      c = 1.0 - c * square * (1.0 / ((2 * k + 3) * (2 * k + 4)));
    }
    c *= 0.5;
    D::at(quarter.e[0], l) = 1.0 - c * (y * y + z * z);
    D::at(quarter.e[1], l) = c * x * y - s * z;
    D::at(quarter.e[2], l) = c * x * z + s * y;
    D::at(quarter.e[3], l) = c * x * y + s * z;
    D::at(quarter.e[4], l) = 1.0 - c * (x * x + z * z);
    D::at(quarter.e[5], l) = c * y * z - s * x;
    D::at(quarter.e[6], l) = c * x * z - s * y;
    D::at(quarter.e[7], l) = c * y * z + s * x;
    D::at(quarter.e[8], l) = 1.0 - c * (x * x + y * y);
  }
  multiply<Bytes, false>(quarter, quarter, half);
  multiply<Bytes, false>(half, half, quarter);
  MatrixBlock whole;
  for (int e = 0; e < 9; ++e) {
    std::fill_n(whole.e[e], kBlock, task.whole[e]);
  }
  multiply<Bytes, false>(whole, quarter, out);
}

void repair(const MatrixBlock& from, int lane, MatrixBlock& to) {
  Matrix3 matrix;
  for (int e = 0; e < 9; ++e) {
    matrix.data()[e] = from.e[e][lane];
  }
  const Matrix3 rotation = closest_rotation(matrix);
  for (int e = 0; e < 9; ++e) {
    to.e[e][lane] = rotation.data()[e];
  }
}

// The closest rotations, to single precision.
template <int Bytes>
SUPPLE_INLINE void find_rotations(const MatrixBlock& from, MatrixBlock& to) {
  using F = Lanes<float, Bytes>;
  bool good[kBlock];
  for (int l = 0; l < kBlock; l += F::count) {
    typename F::type q[9];
    for (int e = 0; e < 9; ++e) {
      for (int i = 0; i < F::count; ++i) {
        q[e][i] = static_cast<float>(from.e[e][l + i]);
      }
    }
    rotation_lanes<float, Bytes>(q, good + l);
    for (int e = 0; e < 9; ++e) {
      for (int i = 0; i < F::count; ++i) {
        to.e[e][l + i] = static_cast<double>(q[e][i]);
      }
    }
  }
  for (int l = 0; l < kBlock; ++l) {
    if (!good[l]) {
      repair(from, l, to);
    }
  }
}

// X = P Q becomes the matrix that a round goes towards: of P - I, `share` is kept and no more than
// `most` in norm. kept: set to what is left of P.
template <int Bytes>
SUPPLE_INLINE void bound_stretch(double share, double most, MatrixBlock& x, MatrixBlock& kept) {
  MatrixBlock q;
  find_rotations<kSingle<Bytes>>(x, q);
  for (int i = 0; i < kBlock; ++i) {
    double size = 0.0;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) {
        double away = r == c ? -1.0 : 0.0;  // P - I = X Q^T - I
        for (int k = 0; k < 3; ++k) {
          away += x.e[3 * r + k][i] * q.e[3 * c + k][i];
        }
        kept.e[3 * r + c][i] = away;
        size += away * away;
      }
    }
    size = std::sqrt(size);
    const double factor = share * (size > most ? most / size : 1.0);
    for (int e = 0; e < 9; ++e) {
      kept.e[e][i] = factor * kept.e[e][i] + (e % 4 == 0 ? 1.0 : 0.0);
    }
  }
  multiply<Bytes, false>(kept, q, x);
}

// What T - J adds at corners 1 and 2 of each face.
template <int Bytes>
SUPPLE_INLINE void set_forces(const RoundTask& task, Eigen::Index block, const MatrixBlock& target,
                              const MatrixBlock& jacobians) {
  using D = Doubles<Bytes>;
  const MatrixBlock& inverse = task.faces->inverse_frames[static_cast<size_t>(block)];
  const double* const areas = task.faces->areas.data() + kBlock * block;
  alignas(64) double forces[6][kBlock];
  for (int l = 0; l < kBlock; l += D::kCount) {
    typename D::V away[9], square{};
    for (int e = 0; e < 9; ++e) {
      away[e] = D::at(target.e[e], l) - D::at(jacobians.e[e], l);
      square += away[e] * away[e];
    }
    // Away by less than rounding: 0, without a comparison, of which GCC makes a loop.
    alignas(64) double weight[D::kCount];
    D::at(weight, 0) = square;
    for (int i = 0; i < D::kCount; ++i) {
      weight[i] = weight[i] < kRounding * kRounding ? 0.0 : areas[l + i];
    }
    const typename D::V& area = D::at(weight, 0);
    // Columns 0 and 1 of E^-1 are the gradients of the functions that are 1 at corners 1 and 2.
    for (int corner = 0; corner < 2; ++corner) {
      for (int j = 0; j < 3; ++j) {
        D::at(forces[3 * corner + j], l) = area * (D::at(inverse.e[corner], l) * away[j] +
                                                   D::at(inverse.e[3 + corner], l) * away[3 + j] +
                                                   D::at(inverse.e[6 + corner], l) * away[6 + j]);
      }
    }
  }
  const Eigen::Index first = kBlock * block,
                     count = std::min(kBlock, task.faces->operators.faces.rows() - first);
  for (Eigen::Index i = 0; i < count; ++i) {
    auto& force = task.forces->at(first + i);
    for (int j = 0; j < 3; ++j) {
      force.one[j] = static_cast<float>(forces[j][i]);
      force.two[j] = static_cast<float>(forces[3 + j][i]);
    }
  }
}

// Bytes: of vectors of doubles.
template <RoundKind Kind, int Bytes>
SUPPLE_INLINE void run(const RoundTask& task, Eigen::Index first, Eigen::Index last) {
  const Eigen::Index m = task.faces->operators.faces.rows();
  for (Eigen::Index block = first; block < last; ++block) {
    const auto here = static_cast<size_t>(block);
    const Eigen::Index count = std::min(kBlock, m - kBlock * block);
    const MatrixBlock* const stretch = task.stretch == nullptr ? nullptr : task.stretch + here;
    MatrixBlock jacobians, target, other;
    moved_jacobians<Bytes>(task, block, jacobians);
    if constexpr (Kind == RoundKind::turned) {
      turn<Bytes>(task, block, target);
    } else if constexpr (Kind == RoundKind::bounded) {
      load_rows(task.given + 9 * kBlock * block, count, target);
      bound_stretch<Bytes>(task.share, task.most, target, task.kept[here]);
      if (stretch != nullptr) {
        multiply<Bytes, false>(*stretch, task.kept[here], other);
        task.kept[here] = other;
      }
    } else if (stretch == nullptr) {
      find_rotations<kSingle<Bytes>>(jacobians, target);
    } else {
      multiply<Bytes, true>(*stretch, jacobians, other);
      find_rotations<kSingle<Bytes>>(other, target);
    }
    if constexpr (Kind == RoundKind::find) {
      for (Eigen::Index i = 0; i < count; ++i) {
        for (int e = 0; e < 9; ++e) {
          task.rotations[9 * (kBlock * block + i) + e] = target.e[e][i];
        }
      }
    } else if (stretch == nullptr) {
      set_forces<Bytes>(task, block, target, jacobians);
    } else {
      multiply<Bytes, false>(*stretch, target, other);
      set_forces<Bytes>(task, block, other, jacobians);
    }
  }
}

template <RoundKind Kind>
struct Kernels {
  SUPPLE_AVX512 static void avx512(const RoundTask& task, Eigen::Index first, Eigen::Index last) {
    run<Kind, 64>(task, first, last);
  }
  SUPPLE_AVX2 static void avx2(const RoundTask& task, Eigen::Index first, Eigen::Index last) {
    run<Kind, 32>(task, first, last);
  }
  static void plain(const RoundTask& task, Eigen::Index first, Eigen::Index last) {
    run<Kind, 16>(task, first, last);
  }
  static RoundKernel best() {
    static const RoundKernel kernel = best_kernel<RoundKernel>(&avx512, &avx2, &plain);
    return kernel;
  }
};

}  // namespace

RoundKernel round_kernel(RoundKind kind) {
  switch (kind) {
    case RoundKind::turned:
      return Kernels<RoundKind::turned>::best();
    case RoundKind::rotations:
      return Kernels<RoundKind::rotations>::best();
    case RoundKind::find:
      return Kernels<RoundKind::find>::best();
    case RoundKind::bounded:
      return Kernels<RoundKind::bounded>::best();
  }
  return nullptr;
}

}  // namespace supple
