// SPDX-License-Identifier: GPL-3.0-or-later
// The derivative of Configuration::equivariant with respect to its signal. A field X_i is seen
//   by faces: L and X_0 in J itself;
//   by samples: its average at a vertex, in the invariants;
//   by the eigenfunctions: coefficients of its averages, whose expansions Y_is are in the
//   invariants
//     and in what vertices contribute to J;
//   in the reference C, for the last field.
// Sums over vertices and faces go by chunks of equal size, added in order: the same for any
// threads.
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "equivariant_parts.h"
#include "vertex_average.h"

namespace supple::equivariant {
namespace {

// k x 16 a field: with respect to the coefficients, from rows x (kScaleCount * fields * 16) with
// respect to the bands' parts at rows of the eigenfunctions.
template <class Scalar>
RowMatrix<Scalar> bands_backward(const std::vector<Eigen::Index>& scales,
                                 const ConstTallBlock<Scalar>& functions,
                                 const RowMatrix<Scalar>& grad) {
  const Eigen::Index columns = grad.cols() / kScaleCount;
  RowMatrix<Scalar> result(functions.cols(), columns);
  Eigen::Index done = 0;
  for (int s = 0; s < kScaleCount; ++s) {
    const Eigen::Index width = scales[static_cast<size_t>(s)] - done;
    if (width > 0) {
      result.middleRows(done, width) = tall_product<Scalar>({functions.middleCols(done, width)},
                                                            grad.middleCols(s * columns, columns));
      done += width;
    }
  }
  return result;
}

// Band b is part of every scale from b on: its gradient is the sum of theirs. Written to the 16
// numbers of field i in each band of one row.
template <class Scalar>
void write_bands(const std::array<Mat3<Scalar>, kScaleCount>& grad, int fields, int i,
                 Scalar* row) {
  Mat3<Scalar> sum = Mat3<Scalar>::Zero();
  for (int s = kScaleCount - 1; s >= 0; --s) {
    sum += grad[static_cast<size_t>(s)];
    Eigen::Map<Mat3<Scalar>>(row + (s * fields + i) * kPadded) = sum;
  }
}

// From the gradient with respect to the numbers of `point_invariants`, that with respect to the
// matrices.
template <class Scalar>
void point_invariants_backward(const std::vector<Mat3<Scalar>>& matrices,
                               const Row3<Scalar>& normal, const Scalar* grad,
                               std::vector<Mat3<Scalar>>& out) {
  out.assign(matrices.size(), Mat3<Scalar>::Zero());
  for (size_t a = 0; a < matrices.size(); ++a) {
    const Mat3<Scalar>& m = matrices[a];
    const Row3<Scalar> normal_a = normal * m;
    Row3<Scalar> grad_normal = Row3<Scalar>::Zero();  // with respect to n A
    for (size_t b = a; b < matrices.size(); ++b) {
      const Scalar whole = *grad++, along = *grad++;
      out[a] += whole * matrices[b];
      out[b] += whole * m;
      grad_normal += along * (normal * matrices[b]);
      out[b] += normal.transpose() * (along * normal_a);
    }
    out[a] += normal.transpose() * grad_normal;
    const Scalar determinant = *grad++;  // its derivative is the cofactors
    for (int row = 0; row < 3; ++row) {
      out[a].row(row) += determinant * m.row((row + 1) % 3).cross(m.row((row + 2) % 3));
    }
  }
}

// What comes together of all the ways from the signal to the answer.
template <class Scalar>
class SignalGradient {
 public:
  SignalGradient(const NetworkContext<Scalar>& context, const Fields<Scalar>& fields)
      : context_(context),
        operators_(*context.operators),
        fields_(fields),
        count_(static_cast<int>(fields.signal->fields.size())),
        coefficients_(RowMatrix<Scalar>::Zero(fields.coefficients.rows(), kPadded * count_)) {
    for (int i = 0; i < count_; ++i) {
      at_vertices_.push_back(MatrixField::Zero(operators_.vertices.rows(), 9));
      at_faces_.push_back(MatrixField::Zero(operators_.faces.rows(), 9));
    }
  }

  void add_invariants(const RowMatrix<Scalar>& grad) {
    const SampleMatrices<Scalar> samples(context_, fields_);
    RowMatrix<Scalar> bands =
        RowMatrix<Scalar>::Zero(context_.samples.size(), kScaleCount * kPadded * count_);
#pragma omp parallel
    {
      std::vector<Mat3<Scalar>> matrices, grads;
#pragma omp for schedule(static)
      for (Eigen::Index p = 0; p < bands.rows(); ++p) {
        const int v = context_.samples[p];
        samples.at(p, matrices);
        const Row3<Scalar> normal = fields_.look->vertex_normals->row(v).template cast<Scalar>();
        point_invariants_backward(matrices, normal, grad.row(p).data(), grads);
        for (int i = 0; i < count_; ++i) {
          matrix_at(at_vertices_[static_cast<size_t>(i)], v) =
              grads[static_cast<size_t>(i)].template cast<double>();
          std::array<Mat3<Scalar>, kScaleCount> scales;
          std::copy_n(grads.begin() + count_ + kScaleCount * i, kScaleCount, scales.begin());
          write_bands(scales, count_, i, bands.row(p).data());
        }
      }
    }
    coefficients_ += bands_backward<Scalar>(context_.scales, context_.domain.functions, bands);
    // Every Y is C and its bands; the first band has the sum over the scales.
    for (int i = 0; i < count_; ++i) {
      const Eigen::Matrix<double, 1, 9> sum =
          bands.middleCols(kPadded * i, 9).template cast<double>().colwise().sum();
      reference_ += Eigen::Map<const Matrix3>(sum.data());
    }
  }

  // What vertices contribute to the Jacobians, through the Y_is.
  void add_combinations(const RowMatrix<Scalar>& outputs, const MatrixField& grad) {
    const Layout layout{count_};
    const Mat3<Scalar> reference = fields_.reference.template cast<Scalar>();
    const Combinations<Scalar> at_faces = combinations_backward(fields_, grad);
    const auto chunks = static_cast<size_t>(chunk_count(operators_.vertices.rows()));
    std::vector<RowMatrix<Scalar>> coefficients(chunks);
    std::vector<Matrix3> references(chunks, Matrix3::Zero());
    for_each_chunk(
        context_, fields_, [&](const Bands<Scalar>& bands, Eigen::Index first, Eigen::Index rows) {
          const auto functions = context_.functions.middleRows(first, rows);
          const auto chunk = static_cast<size_t>(first / kChunk);
          RowMatrix<Scalar> c = RowMatrix<Scalar>::Zero(rows, outputs.cols());
          add_tall_product<Scalar>(Scalar(1), {functions}, outputs, c);
          RowMatrix<Scalar> grad_bands =
              RowMatrix<Scalar>::Zero(rows, kScaleCount * kPadded * count_);
          for (Eigen::Index r = 0; r < rows; ++r) {
            const Combination<Scalar> sum = gathered(operators_, at_faces, first + r);
            const Mat3<Scalar> symmetric = Scalar(2) * defect_of(sum);
            for (int i = 0; i < count_; ++i) {
              std::array<Mat3<Scalar>, kScaleCount> scales;
              Mat3<Scalar> smooth = reference;
              for (int s = 0; s < kScaleCount; ++s) {
                Mat3<Scalar>& here = scales[static_cast<size_t>(s)];
                here = c(r, layout.smooth(i, s)) * matrix_of(sum.along) +
                       c(r, layout.smooth(i, s) + 1) * matrix_of(sum.normal);
                if (i == count_ - 1) {
                  smooth += matrix_of(bands.at(r, i, s));
                  const Mat3<Scalar> squared = c(r, layout.defect(s)) * symmetric * smooth;
                  here += squared;
                  references[chunk] += squared.template cast<double>();
                }
              }
              write_bands(scales, count_, i, grad_bands.row(r).data());
            }
          }
          coefficients[chunk] = bands_backward<Scalar>(context_.scales, functions, grad_bands);
        });
    for (size_t chunk = 0; chunk < chunks; ++chunk) {
      coefficients_ += coefficients[chunk];
      reference_ += references[chunk];
    }
  }

  // L, X_0 and C as faces see them:
  //   J = L + E - e (L - C) + P (F - f (L - C)) + D L + x (X_0 - L) + x' P (X_0 - L).
  void add_faces(const RowMatrix<Scalar>& outputs, const MatrixField& grad) {
    const Combinations<Scalar> at_vertices = combine_at_vertices(context_, fields_, outputs);
    const Eigen::Index m = operators_.faces.rows();
    std::vector<Matrix3> references(static_cast<size_t>(chunk_count(m)), Matrix3::Zero());
#pragma omp parallel for schedule(static)
    for (Eigen::Index first = 0; first < m; first += kChunk) {
      for (Eigen::Index f = first; f < std::min(first + kChunk, m); ++f) {
        Matrix3 defect = Matrix3::Zero();
        double sum = 0.0, normal_sum = 0.0, along_first = 0.0, normal_first = 0.0;
        for (int c = 0; c < 3; ++c) {
          const auto& corner = at_vertices[static_cast<size_t>(operators_.faces(f, c))];
          defect += defect_of(corner).template cast<double>() / 3.0;
          sum += corner.along[kSum] / 3.0;
          normal_sum += corner.along[kNormalSum] / 3.0;
          along_first += corner.along[kFirst] / 3.0;
          normal_first += corner.along[kNormalFirst] / 3.0;
        }
        const Matrix3 g = matrix_at(grad, f);
        const Eigen::RowVector3d normal = fields_.look->face_normals->row(f);
        const Matrix3 across = normal.transpose() * (normal * g);  // P is symmetric
        const Matrix3 of_reference = sum * g + normal_sum * across;
        const Matrix3 of_first = along_first * g + normal_first * across;
        references[static_cast<size_t>(first / kChunk)] += of_reference;
        matrix_at(at_faces_.back(), f) += g - of_reference - of_first + defect.transpose() * g;
        if (count_ > 1) {
          matrix_at(at_faces_.front(), f) += of_first;
        }
      }
    }
    for (const Matrix3& part : references) {
      reference_ += part;
    }
  }

  // From the coefficients, the averages and the reference to the fields.
  Signal fields() && {
    const Eigen::Index n = operators_.vertices.rows();
    std::vector<Matrix3> references(static_cast<size_t>(chunk_count(n)), Matrix3::Zero());
#pragma omp parallel for schedule(static)
    for (Eigen::Index first = 0; first < n; first += kChunk) {
      const Eigen::Index rows = std::min(kChunk, n - first);
      RowMatrix<Scalar> means = RowMatrix<Scalar>::Zero(rows, kPadded * count_);
      add_tall_product<Scalar>(Scalar(1), {context_.functions.middleRows(first, rows)},
                               coefficients_, means);
      for (int i = 0; i < count_; ++i) {
        for (Eigen::Index r = 0; r < rows; ++r) {
          const Matrix3 mean = operators_.mass[first + r] *
                               matrix_of(means.row(r).data() + kPadded * i).template cast<double>();
          matrix_at(at_vertices_[static_cast<size_t>(i)], first + r) += mean;
          references[static_cast<size_t>(first / kChunk)] -= mean;
        }
      }
    }
    for (const Matrix3& part : references) {
      reference_ += part;
    }
    for (size_t i = 0; i < at_faces_.size(); ++i) {
      add_vertex_average_backward(operators_, at_vertices_[i], at_faces_[i]);
    }
    const Matrix3 share = reference_ / operators_.face_areas.sum();
#pragma omp parallel for schedule(static)
    for (Eigen::Index f = 0; f < operators_.faces.rows(); ++f) {
      matrix_at(at_faces_.back(), f) += operators_.face_areas[f] * share;
    }
    return {std::move(at_faces_)};
  }

 private:
  static Eigen::Index chunk_count(Eigen::Index rows) { return (rows + kChunk - 1) / kChunk; }

  const NetworkContext<Scalar>& context_;
  const SurfaceOperators& operators_;
  const Fields<Scalar>& fields_;
  int count_;
  RowMatrix<Scalar> coefficients_;        // k x 16 a field, as `Fields` has them
  std::vector<MatrixField> at_vertices_;  // n x 9 each: with respect to the averages
  std::vector<MatrixField> at_faces_;     // m x 9 each: with respect to the fields
  Matrix3 reference_ = Matrix3::Zero();   // with respect to C
};

}  // namespace

template <class Scalar>
Signal signal_gradient(const NetworkContext<Scalar>& context, const Fields<Scalar>& fields,
                       const RowMatrix<Scalar>& outputs, const MatrixField& grad,
                       const RowMatrix<Scalar>& grad_invariants) {
  SignalGradient<Scalar> gradient(context, fields);
  gradient.add_invariants(grad_invariants);
  gradient.add_combinations(outputs, grad);
  gradient.add_faces(outputs, grad);
  return std::move(gradient).fields();
}

template Signal signal_gradient(const NetworkContext<float>&, const Fields<float>&,
                                const RowMatrix<float>&, const MatrixField&,
                                const RowMatrix<float>&);
template Signal signal_gradient(const NetworkContext<double>&, const Fields<double>&,
                                const RowMatrix<double>&, const MatrixField&,
                                const RowMatrix<double>&);

}  // namespace supple::equivariant
