// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/network.h"

#include <Eigen/LU>
#include <string>

#include "equivariant.h"
#include "supple/core/dense.h"
#include "supple/core/error.h"
#include "supple/geometry/operators.h"

namespace supple {
namespace {

using equivariant::kScaleCount;
using equivariant::Mat3;
using equivariant::Row3;

template <class Scalar>
Mat3<Scalar> matrix_in(const RowMatrix<Scalar>& rows, Eigen::Index r, Eigen::Index matrix) {
  return Eigen::Map<const Mat3<Scalar>>(rows.row(r).data() + 9 * matrix);
}

// What all matrices of a signal share, taken out before anything is rounded to Scalar: the mean of
// its last field by area. It turns with the meshes as the fields do.
Matrix3 reference_of(const SurfaceOperators& operators, const Signal& signal) {
  const Eigen::Matrix<double, 1, 9> sum = operators.face_areas.transpose() * signal.fields.back();
  return Eigen::Map<const Matrix3>(sum.data()) / operators.face_areas.sum();
}

// n x 9F: the signal's fields less a reference, averaged to vertices, side by side.
template <class Scalar>
RowMatrix<Scalar> vertex_fields(const SurfaceOperators& operators, const Signal& signal,
                                const Matrix3& reference) {
  const auto fields = static_cast<Eigen::Index>(signal.fields.size());
  RowMatrix<Scalar> result(operators.vertices.rows(), 9 * fields);
  for (Eigen::Index i = 0; i < fields; ++i) {
    MatrixField average = operators.average * signal.fields[static_cast<size_t>(i)];
    average.rowwise() -= Eigen::Map<const Eigen::Matrix<double, 1, 9>>(reference.data());
    result.middleCols(9 * i, 9) = average.cast<Scalar>();
  }
  return result;
}

// n x 9 F S: the vertex fields in the first eigenfunctions of each scale, field-major.
template <class Scalar>
RowMatrix<Scalar> smoothed_fields(const NetworkContext<Scalar>& context,
                                  const RowMatrix<Scalar>& fields) {
  const RowMatrix<Scalar> coefficients = product(context.weighted_functions, fields);
  const Eigen::Index field_count = fields.cols() / 9;
  RowMatrix<Scalar> result(fields.rows(), fields.cols() * kScaleCount);
  RowMatrix<Scalar> smooth = RowMatrix<Scalar>::Zero(fields.rows(), fields.cols());
  Eigen::Index done = 0;
  for (int s = 0; s < kScaleCount; ++s) {
    const Eigen::Index width = context.scales[static_cast<size_t>(s)] - done;
    if (width > 0) {
      const RowMatrix<Scalar> band = context.functions.middleCols(done, width);
      const RowMatrix<Scalar> part = coefficients.middleRows(done, width);
      gemm(Scalar(1), band, Op::none, part, Op::none, Scalar(1), smooth);
      done += width;
    }
    for (Eigen::Index i = 0; i < field_count; ++i) {
      result.middleCols(9 * (i * kScaleCount + s), 9) = smooth.middleCols(9 * i, 9);
    }
  }
  return result;
}

template <class Scalar>
RowMatrix<Scalar> invariants(const NetworkContext<Scalar>& context, const RowMatrix<Scalar>& fields,
                             const RowMatrix<Scalar>& smooth, const Mat3<Scalar>& reference) {
  const Eigen::Index field_count = fields.cols() / 9;
  const Eigen::Index smooth_count = smooth.cols() / 9;
  RowMatrix<Scalar> result(context.samples.size(),
                           equivariant::input_count(static_cast<int>(field_count)));
#pragma omp parallel
  {
    std::vector<Mat3<Scalar>> matrices(static_cast<size_t>(field_count + smooth_count));
#pragma omp for schedule(static)
    for (Eigen::Index p = 0; p < context.samples.size(); ++p) {
      const int v = context.samples[p];
      for (Eigen::Index i = 0; i < field_count; ++i) {
        matrices[static_cast<size_t>(i)] = reference + matrix_in(fields, v, i);
      }
      for (Eigen::Index i = 0; i < smooth_count; ++i) {
        matrices[static_cast<size_t>(field_count + i)] = reference + matrix_in(smooth, v, i);
      }
      const Row3<Scalar> normal = context.operators->vertex_normals.row(v).template cast<Scalar>();
      equivariant::point_invariants(matrices, normal, result.row(p).data());
      result.row(p).tail(2 * kScaleCount) = context.shape.row(p);
    }
  }
  return result;
}

// Calls visit(f, bases) with B_b - L for each face, in parallel.
template <class Scalar, class Visit>
void for_each_face_bases(const NetworkContext<Scalar>& context, const Signal& signal,
                         const RowMatrix<Scalar>& smooth, const Visit& visit) {
  const SurfaceOperators& operators = *context.operators;
  const Matrix3 exact_reference = reference_of(operators, signal);
  const Mat3<Scalar> reference = exact_reference.template cast<Scalar>();
  const Mat3<Scalar> defect =
      (exact_reference * exact_reference.transpose() - Matrix3::Identity()).template cast<Scalar>();
  const auto smooth_count = static_cast<size_t>(smooth.cols() / 9);
#pragma omp parallel
  {
    std::vector<Mat3<Scalar>> here(signal.fields.size()), smooth_here(smooth_count);
#pragma omp for schedule(static)
    for (Eigen::Index f = 0; f < operators.faces.rows(); ++f) {
      for (size_t i = 0; i < here.size(); ++i) {
        here[i] = (matrix_at(signal.fields[i], f) - exact_reference).template cast<Scalar>();
      }
      for (size_t i = 0; i < smooth_count; ++i) {
        smooth_here[i].setZero();
        for (int c = 0; c < 3; ++c) {
          smooth_here[i] += matrix_in(smooth, operators.faces(f, c), static_cast<Eigen::Index>(i));
        }
        smooth_here[i] *= Scalar(1.0 / 3.0);
      }
      const Row3<Scalar> normal = operators.face_normals.row(f).template cast<Scalar>();
      visit(f, equivariant::face_bases(here, smooth_here, normal, reference, defect));
    }
  }
}

template <class Scalar>
RowMatrix<Scalar> read_tensor(const std::map<std::string, RowMatrix<float>>& tensors,
                              const std::string& name, Eigen::Index rows, Eigen::Index cols) {
  const auto found = tensors.find(name);
  if (found == tensors.end()) {
    throw Error(ErrorCode::model_file,
                "The weights have no tensor '" + name +
                    "'. They are not a Supple network of this architecture.");
  }
  const RowMatrix<float>& value = found->second;
  if (value.rows() != rows || value.cols() != cols) {
    throw Error(ErrorCode::model_file,
                "The weights' tensor '" + name + "' is " + std::to_string(value.rows()) + " x " +
                    std::to_string(value.cols()) + ", not " + std::to_string(rows) + " x " +
                    std::to_string(cols) + ". They belong to another architecture.");
  }
  if (!value.allFinite()) {
    throw Error(ErrorCode::model_file,
                "The weights' tensor '" + name + "' has numbers that are not finite.");
  }
  return value.template cast<Scalar>();
}

}  // namespace

const char* to_string(Configuration configuration) {
  return configuration == Configuration::paper ? "paper" : "equivariant";
}

Configuration configuration(const std::string& name) {
  if (name == "paper") {
    return Configuration::paper;
  }
  if (name == "equivariant") {
    return Configuration::equivariant;
  }
  throw Error(ErrorCode::bad_option,
              "'" + name + "' is no configuration. Use 'equivariant' or 'paper'.");
}

LayerSizes Architecture::sizes() const {
  LayerSizes sizes;
  sizes.width = width;
  if (configuration == Configuration::equivariant) {
    sizes.inputs = equivariant::input_count(field_count(signal));
    sizes.outputs = equivariant::basis_count(field_count(signal));
  }
  return sizes;
}

template <class Scalar>
NetworkContext<Scalar>::NetworkContext(const SurfaceOperators& surface, const Eigenbasis& basis,
                                       int eigenfunctions, Eigen::Index sample_count)
    : operators(&surface),
      samples(farthest_point_samples(surface.vertices,
                                     sample_count > 0 ? sample_count : surface.vertices.rows())),
      domain(sampled_domain<Scalar>(basis, basis.stable_count(eigenfunctions), surface.vertices,
                                    samples)) {
  complete(basis);
}

template <class Scalar>
NetworkContext<Scalar>::NetworkContext(const SurfaceOperators& surface, const Eigenbasis& basis,
                                       int eigenfunctions, Eigen::VectorXi samples_in,
                                       RowMatrix<Scalar> projector)
    : operators(&surface), samples(std::move(samples_in)) {
  const Eigen::Index k = basis.stable_count(eigenfunctions);
  domain.functions.resize(samples.size(), k);
  for (Eigen::Index p = 0; p < samples.size(); ++p) {
    domain.functions.row(p) = basis.functions.row(samples[p]).head(k).template cast<Scalar>();
  }
  domain.projector = std::move(projector);
  complete(basis);
}

template <class Scalar>
void NetworkContext<Scalar>::complete(const Eigenbasis& basis) {
  const SurfaceOperators& surface = *operators;
  const Eigen::Index k = domain.functions.cols();
  functions = basis.functions.leftCols(k).template cast<Scalar>();
  weighted_functions =
      (basis.functions.leftCols(k).transpose() * basis.mass.asDiagonal()).template cast<Scalar>();
  shape.resize(samples.size(), 2 * kScaleCount);
  for (int s = 0; s < kScaleCount; ++s) {
    const Eigen::Index count = std::min(k, basis.stable_count(equivariant::scale_limit(s)));
    scales.push_back(s + 1 == kScaleCount ? k : count);
    const Points smooth = basis.project(surface.vertices, scales.back());
    for (Eigen::Index p = 0; p < samples.size(); ++p) {
      const Eigen::RowVector3d away = surface.vertices.row(samples[p]) - smooth.row(samples[p]);
      shape(p, 2 * s) = static_cast<Scalar>(away.dot(surface.vertex_normals.row(samples[p])));
      shape(p, 2 * s + 1) = static_cast<Scalar>(away.norm());
    }
  }
}

template <class Scalar>
LocalJacobianNetwork<Scalar>::LocalJacobianNetwork(const Architecture& architecture, uint64_t seed)
    : architecture_(architecture),
      parameters_(LayerParameters<Scalar>::random(
          architecture.sizes(), seed,
          architecture.configuration == Configuration::equivariant ? 0.01 : 1.0)),
      mean_(Row::Zero(architecture.sizes().inputs)),
      scale_(Row::Ones(architecture.sizes().inputs)) {}

template <class Scalar>
LocalJacobianNetwork<Scalar>::LocalJacobianNetwork(
    const Architecture& architecture, const std::map<std::string, RowMatrix<float>>& tensors)
    : architecture_(architecture),
      parameters_(LayerParameters<Scalar>::zeros(architecture.sizes())) {
  const LayerSizes sizes = architecture.sizes();
  for (int l = 0; l < sizes.count(); ++l) {
    const std::string prefix = "layer." + std::to_string(l);
    parameters_.weights[l] =
        read_tensor<Scalar>(tensors, prefix + ".weight", sizes.rows(l), sizes.cols(l));
    parameters_.biases[l] = read_tensor<Scalar>(tensors, prefix + ".bias", 1, sizes.cols(l));
  }
  mean_ = read_tensor<Scalar>(tensors, "input.mean", 1, sizes.inputs);
  scale_ = read_tensor<Scalar>(tensors, "input.scale", 1, sizes.inputs);
}

template <class Scalar>
std::map<std::string, RowMatrix<float>> LocalJacobianNetwork<Scalar>::tensors() const {
  std::map<std::string, RowMatrix<float>> result;
  for (size_t l = 0; l < parameters_.weights.size(); ++l) {
    const std::string prefix = "layer." + std::to_string(l);
    result[prefix + ".weight"] = parameters_.weights[l].template cast<float>();
    result[prefix + ".bias"] = parameters_.biases[l].template cast<float>();
  }
  result["input.mean"] = mean_.template cast<float>();
  result["input.scale"] = scale_.template cast<float>();
  return result;
}

template <class Scalar>
void LocalJacobianNetwork<Scalar>::set_normalisation(const Row& mean, const Row& scale) {
  mean_ = mean;
  scale_ = scale;
}

template <class Scalar>
RowMatrix<Scalar> LocalJacobianNetwork<Scalar>::inputs(const NetworkContext<Scalar>& context,
                                                       const Signal& signal,
                                                       RowMatrix<Scalar>* smooth) const {
  if (architecture_.configuration == Configuration::equivariant) {
    const Matrix3 reference = reference_of(*context.operators, signal);
    const RowMatrix<Scalar> fields = vertex_fields<Scalar>(*context.operators, signal, reference);
    *smooth = smoothed_fields(context, fields);
    return invariants<Scalar>(context, fields, *smooth, reference.template cast<Scalar>());
  }
  const RowMatrix<Scalar> fields =
      vertex_fields<Scalar>(*context.operators, signal, Matrix3::Zero());
  RowMatrix<Scalar> result(context.samples.size(), 9);
  for (Eigen::Index p = 0; p < result.rows(); ++p) {
    result.row(p) = fields.row(context.samples[p]).head(9);
  }
  return result;
}

template <class Scalar>
RowMatrix<Scalar> LocalJacobianNetwork<Scalar>::raw_inputs(const NetworkContext<Scalar>& context,
                                                           const Signal& signal) const {
  RowMatrix<Scalar> smooth;
  return inputs(context, signal, &smooth);
}

template <class Scalar>
MatrixField LocalJacobianNetwork<Scalar>::forward(const NetworkContext<Scalar>& context,
                                                  const Signal& signal, Trace* trace) const {
  const SurfaceOperators& operators = *context.operators;
  RowMatrix<Scalar> smooth;
  RowMatrix<Scalar> input = inputs(context, signal, &smooth);
  input.rowwise() -= mean_;
  input.array().rowwise() *= scale_.array();
  RowMatrix<Scalar> output =
      spectral_mlp_forward(architecture_.sizes(), parameters_, context.domain, input,
                           trace != nullptr ? &trace->mlp : nullptr);

  MatrixField result(operators.faces.rows(), 9);
  if (architecture_.configuration == Configuration::paper) {
    if (output.rows() != operators.vertices.rows()) {
      throw Error(ErrorCode::bad_option,
                  "The 'paper' configuration is evaluated at every vertex: use 0 samples.");
    }
    result = average_vertices_to_faces(operators.faces, output).template cast<double>();
    return result;
  }
  const RowMatrix<Scalar> at_vertices =
      product(context.functions, product(context.domain.projector, output));
  const RowMatrix<Scalar> coefficients = average_vertices_to_faces(operators.faces, at_vertices);
  for_each_face_bases(context, signal, smooth, [&](Eigen::Index f, const auto& bases) {
    Mat3<Scalar> correction = Mat3<Scalar>::Zero();
    for (Eigen::Index b = 0; b < coefficients.cols(); ++b) {
      correction += coefficients(f, b) * bases[static_cast<size_t>(b)];
    }
    matrix_at(result, f) = matrix_at(signal.fields.back(), f) + correction.template cast<double>();
  });
  if (trace != nullptr) {
    trace->smooth = std::move(smooth);
  }
  return result;
}

template <class Scalar>
void LocalJacobianNetwork<Scalar>::backward(const NetworkContext<Scalar>& context,
                                            const Signal& signal, const Trace& trace,
                                            const MatrixField& grad,
                                            LayerParameters<Scalar>& gradient) const {
  const SurfaceOperators& operators = *context.operators;
  const Eigen::Index n = operators.vertices.rows();
  RowMatrix<Scalar> grad_output;
  if (architecture_.configuration == Configuration::paper) {
    const RowMatrix<Scalar> grad_faces = grad.template cast<Scalar>();
    grad_output = average_vertices_to_faces_backward(operators.faces, n, grad_faces);
  } else {
    RowMatrix<Scalar> grad_coefficients(operators.faces.rows(), architecture_.sizes().outputs);
    for_each_face_bases(context, signal, trace.smooth, [&](Eigen::Index f, const auto& bases) {
      const Mat3<Scalar> g = matrix_at(grad, f).template cast<Scalar>();
      for (Eigen::Index b = 0; b < grad_coefficients.cols(); ++b) {
        grad_coefficients(f, b) = bases[static_cast<size_t>(b)].cwiseProduct(g).sum();
      }
    });
    const RowMatrix<Scalar> at_vertices =
        average_vertices_to_faces_backward(operators.faces, n, grad_coefficients);
    const RowMatrix<Scalar> spectral =
        product(context.functions, Op::transpose, at_vertices, Op::none);
    grad_output = product(context.domain.projector, Op::transpose, spectral, Op::none);
  }
  spectral_mlp_backward(architecture_.sizes(), parameters_, context.domain, trace.mlp, grad_output,
                        gradient);
}

template struct NetworkContext<float>;
template struct NetworkContext<double>;
template class LocalJacobianNetwork<float>;
template class LocalJacobianNetwork<double>;

}  // namespace supple
