// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings.h"
#include "supple/learning/diffusion_net.h"
#include "supple/learning/feature_inputs.h"

namespace supple::bindings {
namespace {

using Tensors = std::map<std::string, RowMatrix<float>>;

// A surface and what the network needs of it. Rows are those of the vertices with a face.
struct FeatureSurface {
  FeatureSurface(const Points& vertices, const Faces& faces, int eigenfunctions)
      : operators(TriangleMesh(vertices, faces)),
        basis(eigenbasis(operators.laplacian, operators.mass, {.count = eigenfunctions + 1})),
        context(operators, basis, eigenfunctions) {}

  SurfaceOperators operators;
  Eigenbasis basis;
  DiffusionContext<float> context;
};

struct DiffusionNet {
  DiffusionNet(const DiffusionSizes& s, DiffusionParameters<float> p)
      : sizes(s), parameters(std::move(p)), adam(s) {}

  DiffusionSizes sizes;
  DiffusionParameters<float> parameters;
  DiffusionAdam<float> adam;
};

std::pair<Tensors, RowMatrix<float>> gradient(const DiffusionNet& net,
                                              const FeatureSurface& surface,
                                              const RowMatrix<float>& inputs,
                                              const RowMatrix<float>& grad) {
  DiffusionTrace<float> trace;
  diffusion_net_forward(net.sizes, net.parameters, surface.context, inputs, &trace);
  auto result = DiffusionParameters<float>::zeros(net.sizes);
  RowMatrix<float> grad_inputs =
      diffusion_net_backward(net.sizes, net.parameters, surface.context, trace, grad, result);
  return {result.tensors(), std::move(grad_inputs)};
}

void step(DiffusionNet& net, const FeatureSurface& surface, const RowMatrix<float>& inputs,
          const RowMatrix<float>& grad, double learning_rate) {
  DiffusionTrace<float> trace;
  diffusion_net_forward(net.sizes, net.parameters, surface.context, inputs, &trace);
  auto slope = DiffusionParameters<float>::zeros(net.sizes);
  diffusion_net_backward(net.sizes, net.parameters, surface.context, trace, grad, slope);
  net.adam.step(slope, learning_rate, net.parameters);
}

}  // namespace

void bind_features(py::module_& module) {
  const DiffusionSizes defaults;
  py::class_<DiffusionSizes>(module, "DiffusionSizes")
      .def(py::init([](int inputs, int outputs, int width, int blocks) {
             return DiffusionSizes{inputs, outputs, width, blocks};
           }),
           py::arg("inputs") = defaults.inputs, py::arg("outputs") = defaults.outputs,
           py::arg("width") = defaults.width, py::arg("blocks") = defaults.blocks)
      .def_readonly("inputs", &DiffusionSizes::inputs)
      .def_readonly("outputs", &DiffusionSizes::outputs)
      .def_readonly("width", &DiffusionSizes::width)
      .def_readonly("blocks", &DiffusionSizes::blocks);

  py::class_<FeatureSurface>(module, "FeatureSurface")
      .def(py::init<const Points&, const Faces&, int>(), py::arg("vertices"), py::arg("faces"),
           py::arg("eigenfunctions") = 128, NoGil())
      .def(
          "inputs",
          [](const FeatureSurface& surface, const std::string& kind, int count) {
            return feature_inputs(feature_input(kind), surface.operators, surface.basis, count);
          },
          py::arg("kind"), py::arg("count"), NoGil())
      .def_property_readonly("eigenfunctions", [](const FeatureSurface& surface) {
        return surface.context.values.size();
      });

  py::class_<DiffusionNet>(module, "DiffusionNet")
      .def(py::init([](const DiffusionSizes& sizes, const Tensors& tensors) {
             return DiffusionNet(sizes, DiffusionParameters<float>::from_tensors(sizes, tensors));
           }),
           py::arg("sizes"), py::arg("tensors"))
      .def_static(
          "untrained",
          [](const DiffusionSizes& sizes, uint64_t seed) {
            return DiffusionNet(sizes, DiffusionParameters<float>::random(sizes, seed));
          },
          py::arg("sizes"), py::arg("seed"))
      .def_readonly("sizes", &DiffusionNet::sizes)
      .def("tensors", [](const DiffusionNet& net) { return net.parameters.tensors(); })
      .def(
          "features",
          [](const DiffusionNet& net, const FeatureSurface& surface,
             const RowMatrix<float>& inputs) {
            return diffusion_net_forward(net.sizes, net.parameters, surface.context, inputs);
          },
          py::arg("surface"), py::arg("inputs"), NoGil())
      .def("gradient", &gradient, py::arg("surface"), py::arg("inputs"), py::arg("grad"), NoGil())
      .def("step", &step, py::arg("surface"), py::arg("inputs"), py::arg("grad"),
           py::arg("learning_rate"), NoGil());
}

}  // namespace supple::bindings
