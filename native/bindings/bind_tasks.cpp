// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings.h"
#include "supple/core/error.h"
#include "supple/tasks/deform.h"
#include "supple/tasks/edit.h"
#include "supple/tasks/metrics.h"
#include "supple/tasks/prepared_mesh.h"

namespace supple::bindings {
namespace {

using Network = LocalJacobianNetwork<float>;

EditOptions edit_options(const std::string& mode, int rounds, int network_rounds, int passes,
                         bool network, bool loose_pieces_follow) {
  EditOptions options;
  options.mode = edit_mode(mode);
  options.rounds = rounds < 0 ? options.rounds : rounds;
  options.network_rounds = network_rounds < 0 ? options.network_rounds : network_rounds;
  options.passes = passes < 0 ? options.passes : passes;
  options.network = network;
  options.loose_pieces = loose_pieces_follow ? LoosePieces::follow : LoosePieces::stay;
  return options;
}

// The rotations of a `rotation` signal as they are: m x 9, one matrix a face.
Signal signal_of(const PreparedMesh& prepared, const Network& network,
                 const MatrixField& rotations) {
  if (network.architecture().signal != SignalKind::rotation) {
    throw Error(ErrorCode::bad_option, "This network takes the spectral signal, not rotations.");
  }
  if (rotations.rows() != prepared.operators.faces.rows()) {
    throw Error(ErrorCode::wrong_shape,
                "There are " + std::to_string(rotations.rows()) + " rotations for a mesh of " +
                    std::to_string(prepared.operators.faces.rows()) + " faces.");
  }
  return Signal{{rotations}};
}

MatrixField network_forward(const PreparedMesh& prepared, const Network& network,
                            const MatrixField& rotations) {
  return network.forward(*prepared.context_for(network.architecture()),
                         signal_of(prepared, network, rotations));
}

std::map<std::string, RowMatrix<float>> network_gradient(const PreparedMesh& prepared,
                                                         const Network& network,
                                                         const MatrixField& rotations,
                                                         const MatrixField& grad) {
  const Signal signal = signal_of(prepared, network, rotations);
  if (grad.rows() != rotations.rows()) {
    throw Error(ErrorCode::wrong_shape, "There are " + std::to_string(grad.rows()) +
                                            " gradients for " + std::to_string(rotations.rows()) +
                                            " faces.");
  }
  const auto context = prepared.context_for(network.architecture());
  Network::Trace trace;
  network.forward(*context, signal, &trace);
  auto gradient = LayerParameters<float>::zeros(network.architecture().sizes());
  network.backward(*context, signal, trace, grad, gradient);
  std::map<std::string, RowMatrix<float>> result;
  for (size_t layer = 0; layer < gradient.weights.size(); ++layer) {
    const std::string name = "layer." + std::to_string(layer);
    result[name + ".weight"] = std::move(gradient.weights[layer]);
    result[name + ".bias"] = gradient.biases[layer];
  }
  return result;
}

}  // namespace

void bind_tasks(py::module_& module) {
  py::class_<PreparedMesh, std::shared_ptr<PreparedMesh>>(module, "PreparedMesh")
      .def(py::init([](const Points& vertices, const Faces& faces, int eigenfunctions, int samples,
                       Progress* progress, const PreparedCache* cache) {
             return std::make_shared<PreparedMesh>(
                 vertices, faces, PrepareOptions{eigenfunctions, samples}, range(progress), cache);
           }),
           py::arg("vertices"), py::arg("faces"), py::arg("eigenfunctions") = 128,
           py::arg("samples") = 1024, py::arg("progress") = nullptr, py::arg("cache") = nullptr,
           NoGil())
      .def_property_readonly("vertices", [](const PreparedMesh& p) { return p.mesh.vertices(); })
      .def_property_readonly("faces", [](const PreparedMesh& p) { return p.mesh.faces(); })
      .def_property_readonly("notes", [](const PreparedMesh& p) { return p.notes; })
      .def_readonly("from_cache", &PreparedMesh::from_cache)
      .def_property_readonly("diagonal", [](const PreparedMesh& p) { return p.mesh.diagonal(); })
      .def_property_readonly("eigenvalues", [](const PreparedMesh& p) { return p.basis.values; })
      .def_property_readonly("residual", [](const PreparedMesh& p) { return p.basis.residual; });

  py::class_<Handle>(module, "Handle")
      .def(py::init([](const std::string& name, const Eigen::VectorXi& vertices) {
             return Handle{name, vertices};
           }),
           py::arg("name"), py::arg("vertices"));

  py::class_<HandleTarget>(module, "HandleTarget")
      .def(py::init([](const std::optional<Eigen::Matrix4d>& matrix,
                       const std::optional<Points>& positions) {
             return HandleTarget{matrix, positions};
           }),
           py::arg("matrix") = py::none(), py::arg("positions") = py::none());

  py::class_<EditReport>(module, "EditReport")
      .def_readonly("rounds", &EditReport::rounds)
      .def_readonly("passes", &EditReport::passes)
      .def_readonly("network", &EditReport::network)
      .def_readonly("suggestion_milliseconds", &EditReport::suggestion_milliseconds)
      .def_readonly("rounds_milliseconds", &EditReport::rounds_milliseconds)
      .def_readonly("passes_milliseconds", &EditReport::passes_milliseconds)
      .def_readonly("total_milliseconds", &EditReport::total_milliseconds);

  py::class_<Editor>(module, "Editor")
      .def(py::init([](std::shared_ptr<PreparedMesh> prepared, const std::vector<Handle>& handles,
                       std::shared_ptr<Network> network, Progress* progress) {
             return std::make_unique<Editor>(std::move(prepared), handles, std::move(network),
                                             range(progress).stage("factoring", 0.0, 1.0));
           }),
           py::arg("prepared"), py::arg("handles"), py::arg("network"),
           py::arg("progress") = nullptr, NoGil())
      .def(
          "solve",
          [](const Editor& editor, const std::vector<HandleTarget>& targets,
             const std::string& mode, int rounds, int network_rounds, int passes, bool network,
             bool loose_pieces_follow, Progress* progress) {
            EditResult result = editor.solve(
                targets,
                edit_options(mode, rounds, network_rounds, passes, network, loose_pieces_follow),
                range(progress).stage("solving", 0.0, 1.0));
            return std::make_pair(std::move(result.vertices), result.report);
          },
          py::arg("targets"), py::arg("mode") = "natural", py::arg("rounds") = -1,
          py::arg("network_rounds") = -1, py::arg("passes") = -1, py::arg("network") = true,
          py::arg("loose_pieces_follow") = true, py::arg("progress") = nullptr, NoGil());

  module.def(
      "deform",
      [](const PreparedMesh& prepared, const Points& target, int eigenfunctions,
         const Network* network, Progress* progress) {
        return deform(prepared, target, eigenfunctions, network, range(progress));
      },
      py::arg("prepared"), py::arg("target"), py::arg("eigenfunctions"), py::arg("network"),
      py::arg("progress") = nullptr, NoGil());

  module.def("network_forward", &network_forward, py::arg("prepared"), py::arg("network"),
             py::arg("rotations"), NoGil());
  module.def("network_gradient", &network_gradient, py::arg("prepared"), py::arg("network"),
             py::arg("rotations"), py::arg("grad"), NoGil());

  module.def("face_distortion", &face_distortion, py::arg("rest"), py::arg("faces"),
             py::arg("posed"), NoGil());
  module.def("symmetric_dirichlet", &symmetric_dirichlet, py::arg("rest"), py::arg("faces"),
             py::arg("posed"), NoGil());
  module.def("flipped_faces", &flipped_faces, py::arg("rest"), py::arg("faces"), py::arg("posed"),
             NoGil());
  module.def("pose_error", &pose_error, py::arg("rest"), py::arg("faces"), py::arg("posed"),
             py::arg("truth"), NoGil());
}

}  // namespace supple::bindings
