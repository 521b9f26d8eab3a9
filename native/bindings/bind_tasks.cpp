// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings.h"
#include "supple/core/error.h"
#include "supple/tasks/blending.h"
#include "supple/tasks/deform.h"
#include "supple/tasks/edit.h"
#include "supple/tasks/metrics.h"
#include "supple/tasks/prepared_mesh.h"

namespace supple::bindings {
namespace {

using Network = LocalJacobianNetwork<float>;

EditOptions edit_options(const std::string& method, double stiffness, int rounds,
                         int network_rounds, int polish, int passes, bool network,
                         bool loose_pieces_follow, bool keep_volume) {
  const auto set = [](int& option, int value) { option = value < 0 ? option : value; };
  EditOptions options;
  options.method = edit_method(method);
  options.stiffness = stiffness;
  set(options.rounds, rounds);
  set(options.network_rounds, network_rounds);
  set(options.polish, polish);
  set(options.passes, passes);
  options.network = network;
  options.keep_volume = keep_volume;
  options.loose_pieces = loose_pieces_follow ? LoosePieces::follow : LoosePieces::stay;
  return options;
}

std::shared_ptr<const StartPose> start_pose(const Editor& editor,
                                            const std::optional<Points>& vertices) {
  return vertices ? std::make_shared<StartPose>(editor.prepared(), *vertices) : nullptr;
}

std::pair<Points, EditReport> pair_of(EditResult result) {
  return {std::move(result.vertices), result.report};
}

// On the mesh's own vertices and in its units; one that has no face with an area is only itself.
Eigen::VectorXd mesh_falloff_weights(const PreparedMesh& prepared, const Eigen::VectorXi& vertices,
                                     double radius) {
  const TriangleMesh& mesh = prepared.mesh;
  const Eigen::Index n = mesh.vertices().rows();
  Eigen::VectorXd result = Eigen::VectorXd::Zero(n);
  std::vector<int> on_surface;
  for (const int vertex : vertices) {
    if (vertex < 0 || vertex >= n) {
      throw Error(ErrorCode::index_out_of_range, "Vertex " + std::to_string(vertex) +
                                                     " is not in a mesh of " + std::to_string(n) +
                                                     " vertices.");
    }
    result[vertex] = 1.0;
    if (mesh.surface_vertex()[vertex] >= 0) {
      on_surface.push_back(mesh.surface_vertex()[vertex]);
    }
  }
  const Eigen::VectorXd weights = falloff_weights(
      prepared.operators,
      Eigen::Map<Eigen::VectorXi>(on_surface.data(), static_cast<Eigen::Index>(on_surface.size())),
      radius / mesh.scale());
  for (Eigen::Index i = 0; i < weights.size(); ++i) {
    result[mesh.mesh_vertex()[i]] = weights[i];
  }
  return result;
}

// m x 9, read where the caller's array lies.
using FieldView = Eigen::Ref<const MatrixField>;

// The rotations of a `rotation` signal as they are: m x 9, one matrix a face.
Signal signal_of(const PreparedMesh& prepared, const Network& network, const FieldView& rotations) {
  if (network.architecture().signal != SignalKind::rotation) {
    throw Error(ErrorCode::bad_option, "This network takes the spectral signal, not rotations.");
  }
  if (rotations.rows() != prepared.operators.faces.rows()) {
    throw Error(ErrorCode::wrong_shape,
                "There are " + std::to_string(rotations.rows()) + " rotations for a mesh of " +
                    std::to_string(prepared.operators.faces.rows()) + " faces.");
  }
  Signal signal;  // a list in braces would be copied
  signal.fields.emplace_back(rotations);
  return signal;
}

MatrixField network_forward(const PreparedMesh& prepared, const Network& network,
                            const FieldView& rotations) {
  return network.forward(*prepared.context_for(network.architecture()),
                         signal_of(prepared, network, rotations));
}

std::map<std::string, RowMatrix<float>> network_gradient(const PreparedMesh& prepared,
                                                         const Network& network,
                                                         const FieldView& rotations,
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
      .def(py::init([](const std::string& name, const Eigen::VectorXi& vertices, double weight) {
             return Handle{name, vertices, weight};
           }),
           py::arg("name"), py::arg("vertices"), py::arg("weight") = 1.0);

  py::class_<HandleTarget>(module, "HandleTarget")
      .def(py::init([](const std::optional<Eigen::Matrix4d>& matrix,
                       const std::optional<Points>& positions) {
             return HandleTarget{matrix, positions};
           }),
           py::arg("matrix") = py::none(), py::arg("positions") = py::none());

  py::class_<EditOptions>(module, "EditOptions")
      .def(py::init(&edit_options), py::arg("method") = "supple", py::arg("stiffness") = 0.0,
           py::arg("rounds") = -1, py::arg("network_rounds") = -1, py::arg("polish") = -1,
           py::arg("passes") = -1, py::arg("network") = true, py::arg("loose_pieces_follow") = true,
           py::arg("keep_volume") = true);

  py::class_<EditReport>(module, "EditReport")
      .def_readonly("rounds", &EditReport::rounds)
      .def_readonly("polish", &EditReport::polish)
      .def_readonly("passes", &EditReport::passes)
      .def_readonly("network", &EditReport::network)
      .def_readonly("volume_kept", &EditReport::volume_kept)
      .def_readonly("suggestion_milliseconds", &EditReport::suggestion_milliseconds)
      .def_readonly("rounds_milliseconds", &EditReport::rounds_milliseconds)
      .def_readonly("passes_milliseconds", &EditReport::passes_milliseconds)
      .def_readonly("total_milliseconds", &EditReport::total_milliseconds);

  py::class_<Editor, std::shared_ptr<Editor>>(module, "Editor")
      .def(py::init([](std::shared_ptr<PreparedMesh> prepared, const std::vector<Handle>& handles,
                       std::shared_ptr<Network> network, Progress* progress, const Editor* former) {
             return std::make_shared<Editor>(std::move(prepared), handles, std::move(network),
                                             range(progress).stage("factoring", 0.0, 1.0), former);
           }),
           py::arg("prepared"), py::arg("handles"), py::arg("network"),
           py::arg("progress") = nullptr, py::arg("former") = nullptr, NoGil())
      .def(
          "solve",
          [](const Editor& editor, const std::vector<HandleTarget>& targets,
             const EditOptions& options, Progress* progress, const std::optional<Points>& start) {
            return pair_of(editor.solve(targets, options,
                                        range(progress).stage("solving", 0.0, 1.0),
                                        start_pose(editor, start)));
          },
          py::arg("targets"), py::arg("options"), py::arg("progress") = nullptr,
          py::arg("start") = py::none(), NoGil());

  py::class_<EditSession>(module, "EditSession")
      .def(py::init([](std::shared_ptr<Editor> editor, const EditOptions& options) {
             return std::make_unique<EditSession>(std::move(editor), options);
           }),
           py::arg("editor"), py::arg("options"))
      .def(
          "aim",
          [](EditSession& session, const std::vector<HandleTarget>& targets) {
            session.aim(targets);
          },
          py::arg("targets"), NoGil())
      .def(
          "advance",
          [](EditSession& session, double milliseconds) {
            return pair_of(session.advance(milliseconds));
          },
          py::arg("milliseconds"), NoGil())
      .def_property_readonly("settled", &EditSession::settled);

  module.def("blend", &blend, py::arg("rest"), py::arg("posed"), py::arg("strength"),
             py::arg("weights"), NoGil());
  module.def("falloff_weights", &mesh_falloff_weights, py::arg("prepared"), py::arg("vertices"),
             py::arg("radius"), NoGil());

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
