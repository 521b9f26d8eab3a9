// SPDX-License-Identifier: GPL-3.0-or-later
#include "equivariant.h"

#include <Eigen/LU>
#include <algorithm>

#include "combine_kernel.h"
#include "core/prefetch.h"
#include "equivariant_parts.h"
#include "supple/core/simd.h"

namespace supple::equivariant {
namespace {

template <class Scalar>
struct Reference {
  Mat3<Scalar> matrix, defect;  // C, C C^T - I
  explicit Reference(const Matrix3& exact)
      : matrix(exact.template cast<Scalar>()),
        defect((exact * exact.transpose() - Matrix3::Identity()).template cast<Scalar>()) {}
};

// Y Y^T - I with Y = C + e.
template <class Scalar>
Mat3<Scalar> squared_of(const Reference<Scalar>& reference, const Mat3<Scalar>& e) {
  const Mat3<Scalar> mixed = reference.matrix * e.transpose();
  return reference.defect + mixed + mixed.transpose() + e * e.transpose();
}

// 3x3 matrices as nine numbers, in loops that compile for any instruction set.
template <class Scalar>
SUPPLE_INLINE void multiply(const Scalar* a, const Scalar* b, Scalar* out) {
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      out[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
    }
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
    if (f + kAhead < end) {
      for (int corner = 0; corner < 3; ++corner) {
        prefetch(task.at_vertices + task.faces[3 * (f + kAhead) + corner],
                 sizeof(Combination<Scalar>));
      }
    }
    const Combination<Scalar>& a = task.at_vertices[task.faces[3 * f]];
    const Combination<Scalar>& b = task.at_vertices[task.faces[3 * f + 1]];
    const Combination<Scalar>& c = task.at_vertices[task.faces[3 * f + 2]];
    Scalar along[kPadded], across[kPadded], defect[9];
    for (Eigen::Index e = 0; e < kPadded; ++e) {
      along[e] = (a.along[e] + b.along[e] + c.along[e]) * Scalar(1.0 / 3.0);
      across[e] = (a.normal[e] + b.normal[e] + c.normal[e]) * Scalar(1.0 / 3.0);
    }
    for (int e = 0; e < 9; ++e) {
      defect[e] = across[kDefect + kSymmetric[e]];
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
        out[layout.defect(s)] = squared_of(reference, smooth).cwiseProduct(defect_of(grad)).sum();
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
Face<Scalar> face_at(const Fields<Scalar>& fields, Eigen::Index f) {
  const auto lead = matrix_at(fields.signal->fields.back(), f);
  Face<Scalar> face;
  face.whole_lead = lead.template cast<Scalar>();
  face.lead = (lead - fields.reference).template cast<Scalar>();
  face.first = (matrix_at(fields.signal->fields.front(), f) - lead).template cast<Scalar>();
  face.normal = fields.look->face_normals->row(f).template cast<Scalar>();
  return face;
}

// The matrices that `vertex_average` reads.
void prefetch_around(const SurfaceOperators& operators, const Signal& signal, Eigen::Index v) {
  const int* const first = operators.average.outerIndexPtr() + v;
  for (const MatrixField& field : signal.fields) {
    for (int i = first[0]; i < first[1]; ++i) {
      prefetch(field.data() + 9 * operators.average.innerIndexPtr()[i], 9 * sizeof(double));
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
    if (v + kAhead < n) {
      prefetch_around(operators, signal, v + kAhead);
    }
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
SampleMatrices<Scalar>::SampleMatrices(const NetworkContext<Scalar>& context,
                                       const Fields<Scalar>& fields)
    : context_(context), fields_(fields) {
  Eigen::Index done = 0;
  for (int s = 0; s < kScaleCount; ++s) {
    auto& here = smooth_[static_cast<size_t>(s)];
    here = s == 0 ? RowMatrix<Scalar>::Zero(context.samples.size(), fields.coefficients.cols())
                  : smooth_[static_cast<size_t>(s - 1)];
    const Eigen::Index width = context.scales[static_cast<size_t>(s)] - done;
    if (width > 0) {
      add_tall_product<Scalar>(Scalar(1), {context.domain.functions.middleCols(done, width)},
                               fields.coefficients.middleRows(done, width), here);
      done += width;
    }
  }
}

template <class Scalar>
void SampleMatrices<Scalar>::at(Eigen::Index p, std::vector<Mat3<Scalar>>& matrices) const {
  const auto count = static_cast<int>(fields_.signal->fields.size());
  const Mat3<Scalar> reference = fields_.reference.template cast<Scalar>();
  matrices.resize(static_cast<size_t>(matrix_count(count)));
  size_t next = 0;
  for (const MatrixField& field : fields_.signal->fields) {
    const Eigen::Matrix<double, 1, 9> mean =
        vertex_average(*context_.operators, field, context_.samples[p]);
    matrices[next++] = Eigen::Map<const Matrix3>(mean.data()).template cast<Scalar>();
  }
  for (int i = 0; i < count; ++i) {
    for (int s = 0; s < kScaleCount; ++s) {
      matrices[next++] =
          reference + matrix_of(smooth_[static_cast<size_t>(s)].row(p).data() + kPadded * i);
    }
  }
}

template <class Scalar>
RowMatrix<Scalar> invariants(const NetworkContext<Scalar>& context, const Fields<Scalar>& fields) {
  const auto count = static_cast<int>(fields.signal->fields.size());
  RowMatrix<Scalar> result(context.samples.size(), input_count(count));
  const SampleMatrices<Scalar> samples(context, fields);
#pragma omp parallel
  {
    std::vector<Mat3<Scalar>> matrices;
#pragma omp for schedule(static)
    for (Eigen::Index p = 0; p < context.samples.size(); ++p) {
      samples.at(p, matrices);
      const Row3<Scalar> normal =
          fields.look->vertex_normals->row(context.samples[p]).template cast<Scalar>();
      point_invariants(matrices, normal, result.row(p).data());
      result.row(p).tail(2 * kScaleCount) = fields.look->shape.row(p);
    }
  }
  return result;
}

template <class Scalar>
Combinations<Scalar> combine_at_vertices(const NetworkContext<Scalar>& context,
                                         const Fields<Scalar>& fields,
                                         const RowMatrix<Scalar>& outputs) {
  const Eigen::Index n = context.functions.rows();
  const CombineKernel<Scalar> kernel(context, fields, outputs);
  auto at_vertices = std::make_unique_for_overwrite<Combination<Scalar>[]>(static_cast<size_t>(n));
#pragma omp parallel for schedule(static)
  for (Eigen::Index first = 0; first < n; first += kChunk) {
    kernel.combine(first, std::min(first + kChunk, n), at_vertices.get());
  }
  return at_vertices;
}

template <class Scalar>
MatrixField correct_faces(const NetworkContext<Scalar>& context, const Fields<Scalar>& fields,
                          const RowMatrix<Scalar>& outputs) {
  const SurfaceOperators& operators = *context.operators;
  const Combinations<Scalar> at_vertices = combine_at_vertices(context, fields, outputs);
  const Eigen::Index m = operators.faces.rows();
  MatrixField result(m, 9);
  FaceTask<Scalar> task{operators.faces.data(),
                        fields.signal->fields.back().data(),
                        fields.signal->fields.front().data(),
                        fields.look->face_normals->data(),
                        {},
                        at_vertices.get(),
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
Combinations<Scalar> combinations_backward(const Fields<Scalar>& fields, const MatrixField& grad) {
  auto at_faces =
      std::make_unique_for_overwrite<Combination<Scalar>[]>(static_cast<size_t>(grad.rows()));
#pragma omp parallel for schedule(static)
  for (Eigen::Index f = 0; f < grad.rows(); ++f) {
    const Face<Scalar> face = face_at(fields, f);
    const Mat3<Scalar> g = matrix_at(grad, f).template cast<Scalar>() * Scalar(1.0 / 3.0);
    const Mat3<Scalar> normal = face.normal.transpose() * (face.normal * g);  // P is symmetric
    Combination<Scalar>& c = at_faces[static_cast<size_t>(f)];
    c = {};
    Eigen::Map<Mat3<Scalar>>(c.along) = g;
    Eigen::Map<Mat3<Scalar>>(c.normal) = normal;
    const Mat3<Scalar> defect = g * face.whole_lead.transpose();
    for (int i = 0; i < 3; ++i) {
      for (int j = i; j < 3; ++j) {
        c.normal[kDefect + kSymmetric[3 * i + j]] = Scalar(0.5) * (defect(i, j) + defect(j, i));
      }
    }
    c.along[kSum] = -g.cwiseProduct(face.lead).sum();
    c.along[kNormalSum] = -normal.cwiseProduct(face.lead).sum();
    c.along[kFirst] = g.cwiseProduct(face.first).sum();
    c.along[kNormalFirst] = normal.cwiseProduct(face.first).sum();
  }
  return at_faces;
}

template <class Scalar>
RowMatrix<Scalar> correct_faces_backward(const NetworkContext<Scalar>& context,
                                         const Fields<Scalar>& fields, const MatrixField& grad) {
  const SurfaceOperators& operators = *context.operators;
  const Reference<Scalar> reference(fields.reference);
  const Combinations<Scalar> at_faces = combinations_backward(fields, grad);
  const int outputs = output_count(static_cast<int>(fields.signal->fields.size()));
  RowMatrix<Scalar> at_vertices(operators.vertices.rows(), outputs);
  for_each_chunk(context, fields,
                 [&](const Bands<Scalar>& bands, Eigen::Index first, Eigen::Index rows) {
                   for (Eigen::Index r = 0; r < rows; ++r) {
                     combine_backward(bands, r, reference, gathered(operators, at_faces, first + r),
                                      at_vertices.row(first + r).data());
                   }
                 });
  return tall_product<Scalar>({context.functions}, at_vertices);
}

#define SUPPLE_INSTANTIATE(Scalar)                                                                \
  template Fields<Scalar> project_fields(const NetworkContext<Scalar>&, const Signal&);           \
  template RowMatrix<Scalar> invariants(const NetworkContext<Scalar>&, const Fields<Scalar>&);    \
  template MatrixField correct_faces(const NetworkContext<Scalar>&, const Fields<Scalar>&,        \
                                     const RowMatrix<Scalar>&);                                   \
  template class SampleMatrices<Scalar>;                                                          \
  template Combinations<Scalar> combine_at_vertices(                                              \
      const NetworkContext<Scalar>&, const Fields<Scalar>&, const RowMatrix<Scalar>&);            \
  template Combinations<Scalar> combinations_backward(const Fields<Scalar>&, const MatrixField&); \
  template RowMatrix<Scalar> correct_faces_backward(const NetworkContext<Scalar>&,                \
                                                    const Fields<Scalar>&, const MatrixField&);
SUPPLE_INSTANTIATE(float)
SUPPLE_INSTANTIATE(double)
#undef SUPPLE_INSTANTIATE

}  // namespace supple::equivariant
