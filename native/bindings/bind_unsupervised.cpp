// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings.h"
#include "supple/learning/soft_map.h"
#include "supple/learning/unsupervised_loss.h"
#include "supple/tasks/prepared_mesh.h"

namespace supple::bindings {
namespace {

struct LossOfPair {
  Match match;
  UnsupervisedLossValues values;
  FeaturePair<double> grad_features;
  std::array<MatrixField, 2> grad_predicted;
};

LossOfPair loss_of_pair(const PreparedMesh& first, const PreparedMesh& second,
                        const FeaturePair<double>& features,
                        const std::array<MatrixField, 2>& predicted, Eigen::Index functions,
                        const UnsupervisedOptions& options, Progress* progress) {
  const MatchSurface a(first.operators, first.basis, functions);
  const MatchSurface b(second.operators, second.basis, functions);
  const SurfacePair pair = {&a, &b};
  LossOfPair result;
  result.match = match(pair, features, options, range(progress).stage("matching", 0.0, 0.4));
  UnsupervisedLossGradient gradient;
  result.values = unsupervised_loss(pair, result.match, predicted, options, &gradient);
  result.grad_predicted = std::move(gradient.predicted);
  result.grad_features = match_backward(pair, features, result.match, gradient.match, options,
                                        range(progress).stage("derivatives", 0.4, 1.0));
  return result;
}

}  // namespace

void bind_unsupervised(py::module_& module) {
  // From the first features' surface to the second's.
  using SoftMap = SoftMapPair<double>;
  py::class_<SoftMap>(module, "SoftMap")
      .def(py::init([](const RowMatrix<double>& source, const RowMatrix<double>& target,
                       double temperature, Progress* progress) {
             return SoftMap(source, target, temperature, range(progress));
           }),
           py::arg("source"), py::arg("target"), py::arg("temperature") = 0.07,
           py::arg("progress") = nullptr, NoGil())
      .def(
          "apply",
          [](const SoftMap& map, const RowMatrix<double>& values, Progress* progress) {
            return map.apply({RowMatrix<double>(), values}, range(progress))[0].values;
          },
          py::arg("values"), py::arg("progress") = nullptr, NoGil())
      .def(
          "hard_map",
          [](const SoftMap& map, Progress* progress) { return map.hard_map(0, range(progress)); },
          py::arg("progress") = nullptr, NoGil());

  py::class_<UnsupervisedOptions>(module, "UnsupervisedOptions")
      .def(py::init<>())
      .def_readwrite("temperature", &UnsupervisedOptions::temperature)
      .def_readwrite("smooth_features", &UnsupervisedOptions::smooth_features)
      .def_property(
          "map_penalty", [](const UnsupervisedOptions& o) { return to_string(o.map.penalty); },
          [](UnsupervisedOptions& o, const std::string& name) {
            o.map.penalty = map_penalty(name);
          })
      .def_property(
          "map_weight", [](const UnsupervisedOptions& o) { return o.map.weight; },
          [](UnsupervisedOptions& o, double weight) { o.map.weight = weight; })
      .def_property(
          "map_exponent", [](const UnsupervisedOptions& o) { return o.map.exponent; },
          [](UnsupervisedOptions& o, double exponent) { o.map.exponent = exponent; })
      .def_readwrite("orthogonality", &UnsupervisedOptions::orthogonality)
      .def_readwrite("coupling", &UnsupervisedOptions::coupling)
      .def_readwrite("bijectivity", &UnsupervisedOptions::bijectivity)
      .def_property(
          "jacobian_weights",
          [](const UnsupervisedOptions& o) {
            return std::array<double, 3>{o.jacobians.fit, o.jacobians.smoothness,
                                         o.jacobians.determinant};
          },
          [](UnsupervisedOptions& o, const std::array<double, 3>& w) {
            o.jacobians = {w[0], w[1], w[2]};
          });

  py::class_<MatchDirection>(module, "MatchDirection")
      .def_readonly("map", &MatchDirection::map)
      .def_readonly("soft_map", &MatchDirection::soft_map)
      .def_readonly("pulled", &MatchDirection::pulled)
      .def_readonly("coarse", &MatchDirection::coarse);

  py::class_<LossOfPair>(module, "UnsupervisedLoss")
      .def_readonly("match", &LossOfPair::match)
      .def_readonly("grad_features", &LossOfPair::grad_features)
      .def_readonly("grad_predicted", &LossOfPair::grad_predicted)
      .def_property_readonly("orthogonality",
                             [](const LossOfPair& l) { return l.values.orthogonality; })
      .def_property_readonly("coupling", [](const LossOfPair& l) { return l.values.coupling; })
      .def_property_readonly("bijectivity",
                             [](const LossOfPair& l) { return l.values.bijectivity; })
      .def_property_readonly("fit", [](const LossOfPair& l) { return l.values.fit; })
      .def_property_readonly("smoothness", [](const LossOfPair& l) { return l.values.smoothness; })
      .def_property_readonly("determinant",
                             [](const LossOfPair& l) { return l.values.determinant; })
      .def_property_readonly("total", [](const LossOfPair& l) { return l.values.total; });

  module.def("unsupervised_loss", &loss_of_pair, py::arg("first"), py::arg("second"),
             py::arg("features"), py::arg("predicted"), py::arg("functions"), py::arg("options"),
             py::arg("progress") = nullptr, NoGil());
}

}  // namespace supple::bindings
