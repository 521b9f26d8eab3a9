// SPDX-License-Identifier: GPL-3.0-or-later
#include "equivariant.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>

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

template <class Scalar>
void combine(const Bands<Scalar>& bands, Eigen::Index r, const Scalar* c,
             const Reference<Scalar>& reference, Combination<Scalar>& out) {
  const Layout layout{bands.fields()};
  out = {};
  Scalar sum(0), normal_sum(0);
  for (int i = 0; i < layout.fields; ++i) {
    // sum_s c_s Y_s = sum over bands b of (sum_{s >= b} c_s) Z_b.
    Scalar plain(0), normal(0);
    for (int s = kScaleCount - 1; s >= 0; --s) {
      plain += c[layout.smooth(i, s)];
      normal += c[layout.smooth(i, s) + 1];
      const Scalar* const z = bands.at(r, i, s);
      for (Eigen::Index e = 0; e < kPadded; ++e) {
        out.along[e] += plain * z[e];
        out.normal[e] += normal * z[e];
      }
    }
    sum += plain;
    normal_sum += normal;
  }
  Mat3<Scalar> smooth = Mat3<Scalar>::Zero(), defect = Mat3<Scalar>::Zero();
  for (int s = 0; s < kScaleCount; ++s) {
    smooth += matrix_of(bands.at(r, layout.fields - 1, s));
    defect += c[layout.defect(s)] * defect_of(reference, smooth);
  }
  Eigen::Map<Mat3<Scalar>>(out.defect) = defect;
  out.along[kSum] = sum;
  out.along[kNormalSum] = normal_sum;
  if (layout.fields > 1) {
    out.along[kFirst] = c[layout.plain(0)];
    out.along[kNormalFirst] = c[layout.plain(0) + 1];
  }
}

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
  face.normal = context.operators->face_normals.row(f).template cast<Scalar>();
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
      const Row3<Scalar> normal = operators.vertex_normals.row(v).template cast<Scalar>();
      point_invariants(matrices, normal, result.row(p).data());
      result.row(p).tail(2 * kScaleCount) = context.shape.row(p);
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
  for_each_chunk(context, fields,
                 [&](const Bands<Scalar>& bands, Eigen::Index first, Eigen::Index rows) {
                   RowMatrix<Scalar> c = RowMatrix<Scalar>::Zero(rows, outputs.cols());
                   add_tall_product<Scalar>(Scalar(1), {context.functions.middleRows(first, rows)},
                                            outputs, c);
                   for (Eigen::Index r = 0; r < rows; ++r) {
                     combine(bands, r, c.row(r).data(), reference,
                             at_vertices[static_cast<size_t>(first + r)]);
                   }
                 });

  MatrixField result(operators.faces.rows(), 9);
  const bool two = fields.signal->fields.size() > 1;
#pragma omp parallel for schedule(static)
  for (Eigen::Index f = 0; f < operators.faces.rows(); ++f) {
    Combination<Scalar> c = {};
    for (int corner = 0; corner < 3; ++corner) {
      const auto& at = at_vertices[static_cast<size_t>(operators.faces(f, corner))];
      for (Eigen::Index e = 0; e < kPadded; ++e) {
        c.along[e] += Scalar(1.0 / 3.0) * at.along[e];
        c.normal[e] += Scalar(1.0 / 3.0) * at.normal[e];
        c.defect[e] += Scalar(1.0 / 3.0) * at.defect[e];
      }
    }
    const Face<Scalar> face = face_at(context, fields, f);
    Mat3<Scalar> correction = matrix_of(c.along) - c.along[kSum] * face.lead;
    Mat3<Scalar> normal = matrix_of(c.normal) - c.along[kNormalSum] * face.lead;
    if (two) {
      correction += c.along[kFirst] * face.first;
      normal += c.along[kNormalFirst] * face.first;
    }
    correction += face.normal.transpose() * (face.normal * normal);
    correction += matrix_of(c.defect) * face.whole_lead;
    matrix_at(result, f) =
        matrix_at(fields.signal->fields.back(), f) + correction.template cast<double>();
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
