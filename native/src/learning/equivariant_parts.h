// SPDX-License-Identifier: GPL-3.0-or-later
// What the forward pass of Configuration::equivariant, its way back to the weights
// (equivariant.cpp) and that to the signal (equivariant_signal.cpp) share.
#pragma once

#include <algorithm>
#include <array>
#include <memory>
#include <vector>

#include "equivariant.h"
#include "supple/core/tall.h"

namespace supple::equivariant {

/// A 3x3 matrix takes 16 numbers, of which 9 are used: whole vectors, without a remainder.
constexpr Eigen::Index kPadded = 16;
/// Vertices worked on together, so that what they share stays in the cache.
constexpr Eigen::Index kChunk = 512;

template <class Scalar>
Mat3<Scalar> matrix_of(const Scalar* numbers) {
  return Eigen::Map<const Mat3<Scalar>>(numbers);
}

/// Where the output's coefficients are, for so many fields.
struct Layout {
  int fields;
  // Of field i < fields - 1 as it is; + 1 with P.
  int plain(int i) const { return 2 * i; }
  // Of field i at scale s; + 1 with P.
  int smooth(int i, int s) const { return 2 * (fields - 1) + 2 * (i * kScaleCount + s); }
  int defect(int s) const { return 2 * (fields - 1) + 2 * fields * kScaleCount + s; }
};

/// What a vertex contributes to J - L at its faces: sum, mixed, defect are
///   E = sum c (Y - C), F = sum c' (Y - C), D = sum c'' (Y Y^T - I)
/// and the sums of c, of c', and the coefficients of X_0 (two fields), so that
///   J - L = E - e (L - C) + P (F - f (L - C)) + D L + x (X_0 - L) + x' P (X_0 - L).
/// 128 bytes in single precision: faces read three of these each.
template <class Scalar>
struct Combination {
  Scalar along[kPadded];   // E; then e, f, x, x' at 9..12
  Scalar normal[kPadded];  // F; then D, which is symmetric, at 9..14
};
enum Place { kSum = 9, kNormalSum = 10, kFirst = 11, kNormalFirst = 12, kDefect = 9 };
/// Where each of a symmetric matrix's nine numbers is among six.
constexpr int kSymmetric[9] = {0, 1, 2, 1, 3, 4, 2, 4, 5};

/// D of a combination; of a gradient, the symmetric part of that with respect to D.
template <class Scalar>
Mat3<Scalar> defect_of(const Combination<Scalar>& combination) {
  Mat3<Scalar> result;
  for (int e = 0; e < 9; ++e) {
    result.data()[e] = combination.normal[kDefect + kSymmetric[e]];
  }
  return result;
}

/// The fields' parts in each band of eigenfunctions between two scales, for some vertices: rows x
/// (fields * 16) a band.
template <class Scalar>
class Bands {
 public:
  Bands(const NetworkContext<Scalar>& context, const Fields<Scalar>& fields)
      : context_(context), fields_(static_cast<int>(fields.coefficients.cols() / kPadded)) {
    Eigen::Index done = 0;
    for (int s = 0; s < kScaleCount; ++s) {
      const Eigen::Index width = context.scales[static_cast<size_t>(s)] - done;
      starts_[static_cast<size_t>(s)] = done;
      coefficients_[static_cast<size_t>(s)] = fields.coefficients.middleRows(done, width);
      done += width;
    }
  }

  int fields() const { return fields_; }
  // Expands for `rows` vertices from `first` on.
  void expand(Eigen::Index first, Eigen::Index rows) {
    values_.setZero(rows, kScaleCount * fields_ * kPadded);
    for (int s = 0; s < kScaleCount; ++s) {
      const RowMatrix<Scalar>& c = coefficients_[static_cast<size_t>(s)];
      if (c.rows() > 0) {
        add_tall_product<Scalar>(
            Scalar(1),
            {context_.functions.block(first, starts_[static_cast<size_t>(s)], rows, c.rows())}, c,
            values_.middleCols(s * fields_ * kPadded, fields_ * kPadded));
      }
    }
  }
  // 16 numbers: field i in band s at row r of those expanded.
  const Scalar* at(Eigen::Index r, int i, int s) const {
    return values_.row(r).data() + (s * fields_ + i) * kPadded;
  }

 private:
  const NetworkContext<Scalar>& context_;
  int fields_;
  std::array<Eigen::Index, kScaleCount> starts_{};
  std::array<RowMatrix<Scalar>, kScaleCount> coefficients_;
  RowMatrix<Scalar> values_;
};

template <class Scalar, class Visit>
void for_each_chunk(const NetworkContext<Scalar>& context, const Fields<Scalar>& fields,
                    const Visit& visit) {
  const Eigen::Index n = context.functions.rows();
#pragma omp parallel
  {
    Bands<Scalar> bands(context, fields);
#pragma omp for schedule(static)
    for (Eigen::Index first = 0; first < n; first += kChunk) {
      const Eigen::Index rows = std::min(kChunk, n - first);
      bands.expand(first, rows);
      visit(bands, first, rows);
    }
  }
}

/// One each of n vertices or m faces, not set to anything at first: threads touch their own.
template <class Scalar>
using Combinations = std::unique_ptr<Combination<Scalar>[]>;

/// n: what each vertex contributes, for k x output_count coefficients.
template <class Scalar>
Combinations<Scalar> combine_at_vertices(const NetworkContext<Scalar>& context,
                                         const Fields<Scalar>& fields,
                                         const RowMatrix<Scalar>& outputs);

/// m: from the m x 9 gradient with respect to the Jacobians, a face's part in that with respect to
/// what each of its three corners contributes.
template <class Scalar>
Combinations<Scalar> combinations_backward(const Fields<Scalar>& fields, const MatrixField& grad);

/// The sum of those parts over a vertex's faces.
template <class Scalar>
Combination<Scalar> gathered(const SurfaceOperators& operators,
                             const Combinations<Scalar>& at_faces, Eigen::Index v) {
  Combination<Scalar> sum = {};
  // The averaging's pattern lists a vertex's faces.
  for (SparseRowMatrix::InnerIterator it(operators.average, v); it; ++it) {
    const auto& at = at_faces[static_cast<size_t>(it.col())];
    for (Eigen::Index e = 0; e < kPadded; ++e) {
      sum.along[e] += at.along[e];
      sum.normal[e] += at.normal[e];
    }
  }
  return sum;
}

/// The matrices whose invariants are taken, at each of the context's samples: the fields as they
/// are, then each at its scales.
template <class Scalar>
class SampleMatrices {
 public:
  SampleMatrices(const NetworkContext<Scalar>& context, const Fields<Scalar>& fields);
  /// Those of sample p, matrix_count of them.
  void at(Eigen::Index p, std::vector<Mat3<Scalar>>& matrices) const;

 private:
  const NetworkContext<Scalar>& context_;
  const Fields<Scalar>& fields_;
  std::array<RowMatrix<Scalar>, kScaleCount> smooth_;  // p x 16 a field: Y_is - C
};

}  // namespace supple::equivariant
