// SPDX-License-Identifier: GPL-3.0-or-later
#include "equivariant.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>

#include "supple/core/simd.h"
#include "supple/core/tall.h"

namespace supple::equivariant {
namespace {

// A 3x3 matrix takes 16 numbers, of which 9 are used: whole vectors, without a remainder.
constexpr Eigen::Index kPadded = 16;
// Vertices worked on together, so that what they share stays in the cache.
constexpr Eigen::Index kChunk = 2048;

template <class Scalar>
Mat3<Scalar> matrix_of(const Scalar* numbers) {
  return Eigen::Map<const Mat3<Scalar>>(numbers);
}

// Where the output's coefficients are, for so many fields.
struct Layout {
  int fields;
  // Of field i < fields - 1 as it is; + 1 with P.
  int plain(int i) const { return 2 * i; }
  // Of field i at scale s; + 1 with P.
  int smooth(int i, int s) const { return 2 * (fields - 1) + 2 * (i * kScaleCount + s); }
  int defect(int s) const { return 2 * (fields - 1) + 2 * fields * kScaleCount + s; }
};

// What a vertex contributes to J - L at its faces: sum, mixed, defect are
//   E = sum c (Y - C), F = sum c' (Y - C), D = sum c'' (Y Y^T - I)
// and the sums of c, of c', and the coefficients of X_0 (two fields), so that
//   J - L = E - e (L - C) + P (F - f (L - C)) + D L + x (X_0 - L) + x' P (X_0 - L).
template <class Scalar>
struct Combination {
  Scalar along[kPadded];   // E; then e, f, x, x' at 9..12
  Scalar normal[kPadded];  // F
  Scalar defect[kPadded];  // D
};
enum Place { kSum = 9, kNormalSum = 10, kFirst = 11, kNormalFirst = 12 };

template <class Scalar>
struct Reference {
  Mat3<Scalar> matrix, defect;  // C, C C^T - I
  explicit Reference(const Matrix3& exact)
      : matrix(exact.template cast<Scalar>()),
        defect((exact * exact.transpose() - Matrix3::Identity()).template cast<Scalar>()) {}
};

// Y Y^T - I with Y = C + e.
template <class Scalar>
Mat3<Scalar> defect_of(const Reference<Scalar>& reference, const Mat3<Scalar>& e) {
  const Mat3<Scalar> mixed = reference.matrix * e.transpose();
  return reference.defect + mixed + mixed.transpose() + e * e.transpose();
}

// The fields' parts in each band of eigenfunctions between two scales, for some vertices: rows x
// (fields * 16) a band.
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

// 3x3 matrices as nine numbers, in loops that compile for any instruction set.
template <class Scalar>
SUPPLE_INLINE void multiply(const Scalar* a, const Scalar* b, Scalar* out) {
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      out[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
    }
  }
}

// What each thread reads and writes.
template <class Scalar>
struct CombineTask {
  Layout layout;
  const Scalar* bands;  // rows x (kScaleCount * fields * kPadded)
  const Scalar* c;      // rows x outputs
  Eigen::Index rows, outputs;
  Scalar reference[9], defect[9];  // C, C C^T - I
  Combination<Scalar>* out;
};

template <class Scalar>
SUPPLE_INLINE void combine_body(const CombineTask<Scalar>& task) {
  const int fields = task.layout.fields;
  for (Eigen::Index r = 0; r < task.rows; ++r) {
    const Scalar* const bands = task.bands + r * kScaleCount * fields * kPadded;
    const Scalar* const c = task.c + r * task.outputs;
    Scalar along[kPadded] = {}, across[kPadded] = {};
    Scalar sum(0), normal_sum(0);
    for (int i = 0; i < fields; ++i) {
      // sum_s c_s Y_s = sum over bands b of (sum_{s >= b} c_s) Z_b.
      Scalar plain(0), normal(0);
      for (int s = kScaleCount - 1; s >= 0; --s) {
        plain += c[task.layout.smooth(i, s)];
        normal += c[task.layout.smooth(i, s) + 1];
        const Scalar* const z = bands + (s * fields + i) * kPadded;
        for (Eigen::Index e = 0; e < kPadded; ++e) {
          along[e] += plain * z[e];
          across[e] += normal * z[e];
        }
      }
      sum += plain;
      normal_sum += normal;
    }
    // Y Y^T - I = (C C^T - I) + (C e^T + e C^T) + e e^T: the middle is linear in e, so its sum is
    // that of the weighted e; only e e^T, symmetric, is summed scale by scale.
    Scalar smooth[9] = {}, weighted[9] = {}, square[6] = {}, total(0);
    for (int s = 0; s < kScaleCount; ++s) {
      const Scalar* const z = bands + (s * fields + fields - 1) * kPadded;
      const Scalar d = c[task.layout.defect(s)];
      total += d;
      for (int e = 0; e < 9; ++e) {
        smooth[e] += z[e];
        weighted[e] += d * smooth[e];
      }
      const Scalar *const u = smooth, *const v = smooth + 3, *const w = smooth + 6;
      square[0] += d * (u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
      square[1] += d * (u[0] * v[0] + u[1] * v[1] + u[2] * v[2]);
      square[2] += d * (u[0] * w[0] + u[1] * w[1] + u[2] * w[2]);
      square[3] += d * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
      square[4] += d * (v[0] * w[0] + v[1] * w[1] + v[2] * w[2]);
      square[5] += d * (w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
    }
    Combination<Scalar>& out = task.out[r];
    constexpr int kSymmetric[9] = {0, 1, 2, 1, 3, 4, 2, 4, 5};
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        Scalar mixed(0);
        for (int e = 0; e < 3; ++e) {
          mixed += task.reference[3 * i + e] * weighted[3 * j + e] +
                   weighted[3 * i + e] * task.reference[3 * j + e];
        }
        out.defect[3 * i + j] =
            total * task.defect[3 * i + j] + mixed + square[kSymmetric[3 * i + j]];
      }
    }
    for (Eigen::Index e = 9; e < kPadded; ++e) {
      out.defect[e] = Scalar(0);
    }
    for (Eigen::Index e = 0; e < kPadded; ++e) {
      out.along[e] = along[e];
      out.normal[e] = across[e];
    }
    out.along[kSum] = sum;
    out.along[kNormalSum] = normal_sum;
    out.along[kFirst] = fields > 1 ? c[task.layout.plain(0)] : Scalar(0);
    out.along[kNormalFirst] = fields > 1 ? c[task.layout.plain(0) + 1] : Scalar(0);
  }
}

template <class Scalar>
struct FaceTask {
  const int* faces;       // m x 3
  const double* lead;     // m x 9, L
  const double* first;    // m x 9, X_0
  const double* normals;  // m x 3
  double reference[9];
  const Combination<Scalar>* at_vertices;
  double* out;  // m x 9
};

template <class Scalar>
SUPPLE_INLINE void correct_body(const FaceTask<Scalar>& task, Eigen::Index begin,
                                Eigen::Index end) {
  for (Eigen::Index f = begin; f < end; ++f) {
    const Combination<Scalar>& a = task.at_vertices[task.faces[3 * f]];
    const Combination<Scalar>& b = task.at_vertices[task.faces[3 * f + 1]];
    const Combination<Scalar>& c = task.at_vertices[task.faces[3 * f + 2]];
    Scalar along[kPadded], across[kPadded], defect[kPadded];
    for (Eigen::Index e = 0; e < kPadded; ++e) {
      along[e] = (a.along[e] + b.along[e] + c.along[e]) * Scalar(1.0 / 3.0);
      across[e] = (a.normal[e] + b.normal[e] + c.normal[e]) * Scalar(1.0 / 3.0);
      defect[e] = (a.defect[e] + b.defect[e] + c.defect[e]) * Scalar(1.0 / 3.0);
    }
    const double *const lead = task.lead + 9 * f, *const first = task.first + 9 * f;
    Scalar whole[9], bent[9], correction[9];
    for (int e = 0; e < 9; ++e) {
      whole[e] = static_cast<Scalar>(lead[e]);
      const auto moved = static_cast<Scalar>(lead[e] - task.reference[e]);
      const auto other = static_cast<Scalar>(first[e] - lead[e]);
      along[e] += along[kFirst] * other - along[kSum] * moved;
      across[e] += along[kNormalFirst] * other - along[kNormalSum] * moved;
    }
    multiply(defect, whole, bent);
    Scalar normal[3], through[3];
    for (int e = 0; e < 3; ++e) {
      normal[e] = static_cast<Scalar>(task.normals[3 * f + e]);
    }
    for (int j = 0; j < 3; ++j) {
      through[j] = normal[0] * across[j] + normal[1] * across[3 + j] + normal[2] * across[6 + j];
    }
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        correction[3 * i + j] = along[3 * i + j] + bent[3 * i + j] + normal[i] * through[j];
      }
    }
    for (int e = 0; e < 9; ++e) {
      task.out[9 * f + e] = lead[e] + static_cast<double>(correction[e]);
    }
  }
}

template <class Scalar>
struct Kernels {
  SUPPLE_AVX512 static void combine_avx512(const CombineTask<Scalar>& task) { combine_body(task); }
  SUPPLE_AVX2 static void combine_avx2(const CombineTask<Scalar>& task) { combine_body(task); }
  static void combine_plain(const CombineTask<Scalar>& task) { combine_body(task); }
  SUPPLE_AVX512 static void correct_avx512(const FaceTask<Scalar>& task, Eigen::Index begin,
                                           Eigen::Index end) {
    correct_body(task, begin, end);
  }
  SUPPLE_AVX2 static void correct_avx2(const FaceTask<Scalar>& task, Eigen::Index begin,
                                       Eigen::Index end) {
    correct_body(task, begin, end);
  }
  static void correct_plain(const FaceTask<Scalar>& task, Eigen::Index begin, Eigen::Index end) {
    correct_body(task, begin, end);
  }
};

// Gradient with respect to the output's coefficients at one vertex.
template <class Scalar>
void combine_backward(const Bands<Scalar>& bands, Eigen::Index r,
                      const Reference<Scalar>& reference, const Combination<Scalar>& grad,
                      Scalar* out) {
  const Layout layout{bands.fields()};
  for (int i = 0; i < layout.fields; ++i) {
    Mat3<Scalar> smooth = Mat3<Scalar>::Zero();
    for (int s = 0; s < kScaleCount; ++s) {
      smooth += matrix_of(bands.at(r, i, s));
      out[layout.smooth(i, s)] =
          smooth.cwiseProduct(matrix_of(grad.along)).sum() + grad.along[kSum];
      out[layout.smooth(i, s) + 1] =
          smooth.cwiseProduct(matrix_of(grad.normal)).sum() + grad.along[kNormalSum];
      if (i == layout.fields - 1) {
        out[layout.defect(s)] =
            defect_of(reference, smooth).cwiseProduct(matrix_of(grad.defect)).sum();
      }
    }
  }
  if (layout.fields > 1) {
    out[layout.plain(0)] = grad.along[kFirst];
    out[layout.plain(0) + 1] = grad.along[kNormalFirst];
  }
}

// What a face needs besides its corners' combinations.
template <class Scalar>
struct Face {
  Mat3<Scalar> whole_lead, lead, first;  // L, L - C, X_0 - L
  Row3<Scalar> normal;
};

template <class Scalar>
Face<Scalar> face_at(const NetworkContext<Scalar>& context, const Fields<Scalar>& fields,
                     Eigen::Index f) {
  const auto lead = matrix_at(fields.signal->fields.back(), f);
  Face<Scalar> face;
  face.whole_lead = lead.template cast<Scalar>();
  face.lead = (lead - fields.reference).template cast<Scalar>();
  face.first = (matrix_at(fields.signal->fields.front(), f) - lead).template cast<Scalar>();
  face.normal = fields.look->face_normals->row(f).template cast<Scalar>();
  return face;
}

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

}  // namespace

template <class Scalar>
Fields<Scalar> project_fields(const NetworkContext<Scalar>& context, const Signal& signal) {
  const SurfaceOperators& operators = *context.operators;
  const auto count = static_cast<Eigen::Index>(signal.fields.size());
  Fields<Scalar> result;
  result.signal = &signal;
  result.look = &context.rest;
  const Eigen::Matrix<double, 1, 9> sum = operators.face_areas.transpose() * signal.fields.back();
  result.reference = Eigen::Map<const Matrix3>(sum.data()) / operators.face_areas.sum();
  const auto reference = Eigen::Map<const Eigen::Matrix<double, 1, 9>>(result.reference.data());

  const Eigen::Index n = operators.vertices.rows();
  RowMatrix<Scalar> weighted(n, kPadded * count);
#pragma omp parallel for schedule(static)
  for (Eigen::Index v = 0; v < n; ++v) {
    weighted.row(v).setZero();
    for (Eigen::Index i = 0; i < count; ++i) {
      const Eigen::Matrix<double, 1, 9> mean =
          vertex_average(operators, signal.fields[static_cast<size_t>(i)], v) - reference;
      weighted.block(v, kPadded * i, 1, 9) = (operators.mass[v] * mean).template cast<Scalar>();
    }
  }
  result.coefficients = tall_product<Scalar>({context.functions}, weighted);
  return result;
}

template <class Scalar>
RowMatrix<Scalar> invariants(const NetworkContext<Scalar>& context, const Fields<Scalar>& fields) {
  const SurfaceOperators& operators = *context.operators;
  const auto count = static_cast<int>(fields.signal->fields.size());
  const Mat3<Scalar> reference = fields.reference.template cast<Scalar>();
  RowMatrix<Scalar> result(context.samples.size(), input_count(count));
  // Matrices of a sample: the fields as they are, then each at its scales.
  std::array<RowMatrix<Scalar>, kScaleCount> smooth;
  Eigen::Index done = 0;
  for (int s = 0; s < kScaleCount; ++s) {
    auto& here = smooth[static_cast<size_t>(s)];
    here = s == 0 ? RowMatrix<Scalar>::Zero(context.samples.size(), fields.coefficients.cols())
                  : smooth[static_cast<size_t>(s - 1)];
    const Eigen::Index width = context.scales[static_cast<size_t>(s)] - done;
    if (width > 0) {
      add_tall_product<Scalar>(Scalar(1), {context.domain.functions.middleCols(done, width)},
                               fields.coefficients.middleRows(done, width), here);
      done += width;
    }
  }
#pragma omp parallel
  {
    std::vector<Mat3<Scalar>> matrices(static_cast<size_t>(matrix_count(count)));
#pragma omp for schedule(static)
    for (Eigen::Index p = 0; p < context.samples.size(); ++p) {
      const int v = context.samples[p];
      size_t next = 0;
      for (const MatrixField& field : fields.signal->fields) {
        const Eigen::Matrix<double, 1, 9> mean = vertex_average(operators, field, v);
        matrices[next++] = Eigen::Map<const Matrix3>(mean.data()).template cast<Scalar>();
      }
      for (int i = 0; i < count; ++i) {
        for (int s = 0; s < kScaleCount; ++s) {
          matrices[next++] =
              reference + matrix_of(smooth[static_cast<size_t>(s)].row(p).data() + kPadded * i);
        }
      }
      const Row3<Scalar> normal = fields.look->vertex_normals->row(v).template cast<Scalar>();
      point_invariants(matrices, normal, result.row(p).data());
      result.row(p).tail(2 * kScaleCount) = fields.look->shape.row(p);
    }
  }
  return result;
}

template <class Scalar>
MatrixField correct_faces(const NetworkContext<Scalar>& context, const Fields<Scalar>& fields,
                          const RowMatrix<Scalar>& outputs) {
  const SurfaceOperators& operators = *context.operators;
  const Reference<Scalar> reference(fields.reference);
  std::vector<Combination<Scalar>> at_vertices(static_cast<size_t>(operators.vertices.rows()));
  const auto combine = best_kernel(&Kernels<Scalar>::combine_avx512, &Kernels<Scalar>::combine_avx2,
                                   &Kernels<Scalar>::combine_plain);
  for_each_chunk(
      context, fields, [&](const Bands<Scalar>& bands, Eigen::Index first, Eigen::Index rows) {
        RowMatrix<Scalar> c = RowMatrix<Scalar>::Zero(rows, outputs.cols());
        add_tall_product<Scalar>(Scalar(1), {context.functions.middleRows(first, rows)}, outputs,
                                 c);
        CombineTask<Scalar> task{
            {bands.fields()},          bands.at(0, 0, 0), c.data(), rows, outputs.cols(), {}, {},
            at_vertices.data() + first};
        std::copy_n(reference.matrix.data(), 9, task.reference);
        std::copy_n(reference.defect.data(), 9, task.defect);
        combine(task);
      });

  const Eigen::Index m = operators.faces.rows();
  MatrixField result(m, 9);
  FaceTask<Scalar> task{operators.faces.data(),
                        fields.signal->fields.back().data(),
                        fields.signal->fields.front().data(),
                        fields.look->face_normals->data(),
                        {},
                        at_vertices.data(),
                        result.data()};
  std::copy_n(fields.reference.data(), 9, task.reference);
  const auto correct = best_kernel(&Kernels<Scalar>::correct_avx512, &Kernels<Scalar>::correct_avx2,
                                   &Kernels<Scalar>::correct_plain);
#pragma omp parallel for schedule(static)
  for (Eigen::Index begin = 0; begin < m; begin += kChunk) {
    correct(task, begin, std::min(begin + kChunk, m));
  }
  return result;
}

template <class Scalar>
RowMatrix<Scalar> correct_faces_backward(const NetworkContext<Scalar>& context,
                                         const Fields<Scalar>& fields, const MatrixField& grad) {
  const SurfaceOperators& operators = *context.operators;
  const Reference<Scalar> reference(fields.reference);
  std::vector<Combination<Scalar>> at_faces(static_cast<size_t>(operators.faces.rows()));
#pragma omp parallel for schedule(static)
  for (Eigen::Index f = 0; f < operators.faces.rows(); ++f) {
    const Face<Scalar> face = face_at(context, fields, f);
    const Mat3<Scalar> g = matrix_at(grad, f).template cast<Scalar>() * Scalar(1.0 / 3.0);
    const Mat3<Scalar> normal = face.normal.transpose() * (face.normal * g);  // P is symmetric
    Combination<Scalar>& c = at_faces[static_cast<size_t>(f)];
    c = {};
    Eigen::Map<Mat3<Scalar>>(c.along) = g;
    Eigen::Map<Mat3<Scalar>>(c.normal) = normal;
    Eigen::Map<Mat3<Scalar>>(c.defect) = g * face.whole_lead.transpose();
    c.along[kSum] = -g.cwiseProduct(face.lead).sum();
    c.along[kNormalSum] = -normal.cwiseProduct(face.lead).sum();
    c.along[kFirst] = g.cwiseProduct(face.first).sum();
    c.along[kNormalFirst] = normal.cwiseProduct(face.first).sum();
  }
  const int outputs = output_count(static_cast<int>(fields.signal->fields.size()));
  RowMatrix<Scalar> at_vertices(operators.vertices.rows(), outputs);
  for_each_chunk(
      context, fields, [&](const Bands<Scalar>& bands, Eigen::Index first, Eigen::Index rows) {
        for (Eigen::Index r = 0; r < rows; ++r) {
          Combination<Scalar> sum = {};
          // The averaging's pattern lists a vertex's faces.
          for (SparseRowMatrix::InnerIterator it(operators.average, first + r); it; ++it) {
            const auto& at = at_faces[static_cast<size_t>(it.col())];
            for (Eigen::Index e = 0; e < kPadded; ++e) {
              sum.along[e] += at.along[e];
              sum.normal[e] += at.normal[e];
              sum.defect[e] += at.defect[e];
            }
          }
          combine_backward(bands, r, reference, sum, at_vertices.row(first + r).data());
        }
      });
  return tall_product<Scalar>({context.functions}, at_vertices);
}

#define SUPPLE_INSTANTIATE(Scalar)                                                             \
  template Fields<Scalar> project_fields(const NetworkContext<Scalar>&, const Signal&);        \
  template RowMatrix<Scalar> invariants(const NetworkContext<Scalar>&, const Fields<Scalar>&); \
  template MatrixField correct_faces(const NetworkContext<Scalar>&, const Fields<Scalar>&,     \
                                     const RowMatrix<Scalar>&);                                \
  template RowMatrix<Scalar> correct_faces_backward(const NetworkContext<Scalar>&,             \
                                                    const Fields<Scalar>&, const MatrixField&);
SUPPLE_INSTANTIATE(float)
SUPPLE_INSTANTIATE(double)
#undef SUPPLE_INSTANTIATE

}  // namespace supple::equivariant
