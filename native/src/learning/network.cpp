// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/network.h"

#include <string>

#include "equivariant.h"
#include "supple/core/dense.h"
#include "supple/core/error.h"
#include "supple/geometry/operators.h"
#include "tensors.h"
#include "vertex_average.h"

namespace supple {
namespace {

using equivariant::kScaleCount;

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
    sizes.outputs = equivariant::output_count(field_count(signal));
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
  for (int s = 0; s < kScaleCount; ++s) {
    const Eigen::Index count = std::min(k, basis.stable_count(equivariant::scale_limit(s)));
    scales.push_back(s + 1 == kScaleCount ? k : count);
  }
  rest = look(surface.vertices, surface.face_normals, surface.vertex_normals);
}

template <class Scalar>
SurfaceLook<Scalar> NetworkContext<Scalar>::look(const Points& moved, const Points& face_normals,
                                                 const Points& vertex_normals) const {
  SurfaceLook<Scalar> result{&face_normals, &vertex_normals,
                             RowMatrix<Scalar>(samples.size(), 2 * kScaleCount)};
  // Phi^T M x. Rows of equal count are summed together, whatever the number of threads.
  constexpr Eigen::Index kRows = 2048;
  const Eigen::Index n = moved.rows(), k = functions.cols(), chunks = (n + kRows - 1) / kRows;
  std::vector<RowMatrix<double>> parts(static_cast<size_t>(chunks));
#pragma omp parallel for schedule(static)
  for (Eigen::Index i = 0; i < chunks; ++i) {
    const Eigen::Index first = i * kRows, rows = std::min(kRows, n - first);
    const Points weighted =
        operators->mass.segment(first, rows).asDiagonal() * moved.middleRows(first, rows);
    parts[static_cast<size_t>(i)] =
        functions.middleRows(first, rows).template cast<double>().transpose() * weighted;
  }
  RowMatrix<double> coefficients = RowMatrix<double>::Zero(k, 3);
  for (const RowMatrix<double>& part : parts) {
    coefficients += part;
  }
#pragma omp parallel for schedule(static)
  for (Eigen::Index p = 0; p < samples.size(); ++p) {
    Eigen::RowVector3d away = moved.row(samples[p]);
    Eigen::Index done = 0;
    for (int s = 0; s < kScaleCount; ++s) {
      const Eigen::Index width = scales[static_cast<size_t>(s)] - done;
      if (width > 0) {
        away -= domain.functions.row(p).segment(done, width).template cast<double>() *
                coefficients.middleRows(done, width);
        done += width;
      }
      result.shape(p, 2 * s) = static_cast<Scalar>(away.dot(vertex_normals.row(samples[p])));
      result.shape(p, 2 * s + 1) = static_cast<Scalar>(away.norm());
    }
  }
  return result;
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
RowMatrix<Scalar> LocalJacobianNetwork<Scalar>::raw_inputs(const NetworkContext<Scalar>& context,
                                                           const Signal& signal) const {
  if (architecture_.configuration == Configuration::equivariant) {
    return equivariant::invariants(context, equivariant::project_fields(context, signal));
  }
  RowMatrix<Scalar> result(context.samples.size(), 9);
#pragma omp parallel for schedule(static)
  for (Eigen::Index p = 0; p < result.rows(); ++p) {
    result.row(p) = vertex_average(*context.operators, signal.fields.front(), context.samples[p])
                        .template cast<Scalar>();
  }
  return result;
}

template <class Scalar>
MatrixField LocalJacobianNetwork<Scalar>::forward(const NetworkContext<Scalar>& context,
                                                  const Signal& signal, Trace* trace,
                                                  const SurfaceLook<Scalar>* look) const {
  const auto layers = [&](RowMatrix<Scalar> input) {
    input.rowwise() -= mean_;
    input.array().rowwise() *= scale_.array();
    return spectral_mlp_forward(architecture_.sizes(), parameters_, context.domain, input,
                                trace != nullptr ? &trace->mlp : nullptr);
  };
  if (architecture_.configuration == Configuration::paper) {
    const RowMatrix<Scalar> output = layers(raw_inputs(context, signal));
    if (output.rows() != context.operators->vertices.rows()) {
      throw Error(ErrorCode::bad_option,
                  "The 'paper' configuration is evaluated at every vertex: use 0 samples.");
    }
    return average_vertices_to_faces(context.operators->faces, output).template cast<double>();
  }
  auto fields = equivariant::project_fields(context, signal);
  fields.look = look == nullptr ? &context.rest : look;
  const RowMatrix<Scalar> output =
      product(context.domain.projector, layers(equivariant::invariants(context, fields)));
  MatrixField result = equivariant::correct_faces(context, fields, output);
  if (trace != nullptr) {
    trace->reference = fields.reference;
    trace->coefficients = std::move(fields.coefficients);
    trace->outputs = output;
  }
  return result;
}

template <class Scalar>
void LocalJacobianNetwork<Scalar>::backward(const NetworkContext<Scalar>& context,
                                            const Signal& signal, const Trace& trace,
                                            const MatrixField& grad,
                                            LayerParameters<Scalar>& gradient,
                                            Signal* signal_gradient) const {
  const SurfaceOperators& operators = *context.operators;
  const bool paper = architecture_.configuration == Configuration::paper;
  equivariant::Fields<Scalar> fields;
  RowMatrix<Scalar> grad_output;
  if (paper) {
    const RowMatrix<Scalar> grad_faces = grad.template cast<Scalar>();
    grad_output =
        average_vertices_to_faces_backward(operators.faces, operators.vertices.rows(), grad_faces);
  } else {
    fields = {&signal, &context.rest, trace.reference, trace.coefficients};
    const RowMatrix<Scalar> spectral = equivariant::correct_faces_backward(context, fields, grad);
    grad_output = product(context.domain.projector, Op::transpose, spectral, Op::none);
  }
  RowMatrix<Scalar> grad_input = spectral_mlp_backward(
      architecture_.sizes(), parameters_, context.domain, trace.mlp, grad_output, gradient);
  if (signal_gradient == nullptr) {
    return;
  }
  grad_input.array().rowwise() *= scale_.array();
  if (!paper) {
    *signal_gradient =
        equivariant::signal_gradient(context, fields, trace.outputs, grad, grad_input);
    return;
  }
  MatrixField at_vertices = MatrixField::Zero(operators.vertices.rows(), 9);
  for (Eigen::Index p = 0; p < grad_input.rows(); ++p) {
    at_vertices.row(context.samples[p]) = grad_input.row(p).template cast<double>();
  }
  const MatrixField none = MatrixField::Zero(operators.faces.rows(), 9);
  signal_gradient->fields.assign(signal.fields.size(), none);
  add_vertex_average_backward(operators, at_vertices, signal_gradient->fields.front());
}

template struct NetworkContext<float>;
template struct NetworkContext<double>;
template class LocalJacobianNetwork<float>;
template class LocalJacobianNetwork<double>;

}  // namespace supple
