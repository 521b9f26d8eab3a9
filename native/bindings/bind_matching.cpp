// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings.h"
#include "supple/tasks/match.h"

namespace supple::bindings {
namespace {

using Tensors = std::map<std::string, RowMatrix<float>>;
using Network = LocalJacobianNetwork<float>;
using Meshes = std::vector<std::shared_ptr<PreparedMesh>>;

// The part [from, to] of a longer call that is `progress`.
ProgressRange part_of(Progress* progress, const char* name, const std::array<double, 2>& part) {
  return range(progress).stage(name, part[0], part[1]);
}

MatchNetworks with_network(FeatureNetwork<float> features, const Network* network) {
  MatchNetworks result{std::move(features), {}};
  if (network != nullptr) {
    result.jacobians = *network;
  }
  return result;
}

// A trainer and the meshes that its surfaces look into.
struct MeshTrainer {
  MeshTrainer(Meshes meshes_in, std::vector<int> groups, std::vector<GuidePair> guides,
              const MatchNetworks& networks, const JointTrainOptions& options, int functions)
      : meshes(std::move(meshes_in)),
        trainer(surfaces_of(meshes, networks, functions), std::move(groups), std::move(guides),
                networks, options) {}

  static std::vector<std::shared_ptr<const JointSurface<float>>> surfaces_of(
      const Meshes& meshes, const MatchNetworks& networks, int functions) {
    std::vector<std::shared_ptr<const JointSurface<float>>> surfaces;
    for (const auto& mesh : meshes) {
      surfaces.push_back(joint_surface(*mesh, networks, functions));
    }
    return surfaces;
  }

  Meshes meshes;
  JointTrainer trainer;
};

JointEpoch joint_epoch(int epoch, int pairs, double guide, double guide_share,
                       const std::array<double, 7>& terms) {
  JointEpoch result;
  result.epoch = epoch;
  result.pairs = pairs;
  result.guide_share = guide_share;
  result.loss.guide = guide;
  result.loss.terms = {terms[0], terms[1], terms[2], terms[3], terms[4], terms[5], terms[6]};
  return result;
}

}  // namespace

void bind_matching(py::module_& module) {
  py::class_<MatchNetworks, std::shared_ptr<MatchNetworks>>(module, "MatchNetworks")
      .def(py::init([](const std::string& input, const DiffusionSizes& sizes, int eigenfunctions,
                       const Tensors& tensors, const Network* network) {
             const FeatureArchitecture architecture{feature_input(input), sizes, eigenfunctions};
             return with_network(
                 {architecture, DiffusionParameters<float>::from_tensors(sizes, tensors)}, network);
           }),
           py::arg("input"), py::arg("sizes"), py::arg("eigenfunctions"), py::arg("tensors"),
           py::arg("network"))
      .def_static(
          "untrained",
          [](const std::string& input, const DiffusionSizes& sizes, int eigenfunctions,
             uint64_t seed, const Network* network) {
            return with_network(
                FeatureNetwork<float>::random({feature_input(input), sizes, eigenfunctions}, seed),
                network);
          },
          py::arg("input"), py::arg("sizes"), py::arg("eigenfunctions"), py::arg("seed"),
          py::arg("network"))
      .def_property_readonly(
          "input", [](const MatchNetworks& n) { return to_string(n.features.architecture.input); })
      .def_property_readonly("sizes",
                             [](const MatchNetworks& n) { return n.features.architecture.sizes; })
      .def_property_readonly(
          "eigenfunctions",
          [](const MatchNetworks& n) { return n.features.architecture.eigenfunctions; })
      .def("tensors", [](const MatchNetworks& n) { return n.features.parameters.tensors(); })
      .def_property_readonly(
          "network",
          [](const MatchNetworks& n) -> std::shared_ptr<Network> {
            return n.jacobians.has_value() ? std::make_shared<Network>(*n.jacobians) : nullptr;
          })
      .def(
          "features",
          [](const MatchNetworks& n, const PreparedMesh& mesh) {
            return n.features.features(
                FeatureContext<float>(mesh.operators, mesh.basis, n.features.architecture));
          },
          py::arg("mesh"), NoGil());

  py::class_<GuidePair>(module, "GuidePair")
      .def(py::init([](int first, int second, const RowMatrix<double>& there,
                       const RowMatrix<double>& back) {
             return GuidePair{first, second, {there, back}};
           }),
           py::arg("first"), py::arg("second"), py::arg("there"), py::arg("back"));

  py::class_<GuideMaps>(module, "GuideMaps")
      .def_readonly("point_maps", &GuideMaps::point_maps)
      .def_readonly("maps", &GuideMaps::maps)
      .def_readonly("round_trip", &GuideMaps::round_trip);
  module.def(
      "guide_maps",
      [](const PreparedMesh& first, const PreparedMesh& second, int functions, Progress* progress,
         const std::array<double, 2>& part) {
        return guide_maps(first, second, functions, part_of(progress, "looking for guides", part));
      },
      py::arg("first"), py::arg("second"), py::arg("functions"), py::arg("progress") = nullptr,
      py::arg("part") = std::array{0.0, 1.0}, NoGil());

  py::class_<JointTrainOptions>(module, "JointTrainOptions")
      .def(py::init<>())
      .def_readwrite("loss", &JointTrainOptions::loss)
      .def_readwrite("epochs", &JointTrainOptions::epochs)
      .def_readwrite("first_temperature", &JointTrainOptions::first_temperature)
      .def_readwrite("guided_epochs", &JointTrainOptions::guided_epochs)
      .def_readwrite("guide_weight", &JointTrainOptions::guide_weight)
      .def_readwrite("feature_learning_rate", &JointTrainOptions::feature_learning_rate)
      .def_readwrite("jacobian_learning_rate", &JointTrainOptions::jacobian_learning_rate)
      .def_readwrite("largest_gradient", &JointTrainOptions::largest_gradient)
      .def_readwrite("patience", &JointTrainOptions::patience)
      .def_readwrite("seed", &JointTrainOptions::seed);

  py::class_<JointEpoch>(module, "JointEpoch")
      .def(py::init(&joint_epoch), py::arg("epoch"), py::arg("pairs"), py::arg("guide"),
           py::arg("guide_share"), py::arg("terms"))
      .def_readonly("epoch", &JointEpoch::epoch)
      .def_readonly("pairs", &JointEpoch::pairs)
      .def_readonly("guide_share", &JointEpoch::guide_share)
      .def_property_readonly("guide", [](const JointEpoch& e) { return e.loss.guide; })
      .def_property_readonly("terms", [](const JointEpoch& e) {
        const UnsupervisedLossValues& t = e.loss.terms;
        return std::array<double, 7>{t.orthogonality, t.coupling,    t.bijectivity, t.fit,
                                     t.smoothness,    t.determinant, t.total};
      });

  py::class_<MeshTrainer>(module, "JointTrainer")
      .def(py::init<Meshes, std::vector<int>, std::vector<GuidePair>, const MatchNetworks&,
                    const JointTrainOptions&, int>(),
           py::arg("meshes"), py::arg("groups"), py::arg("guides"), py::arg("networks"),
           py::arg("options"), py::arg("functions"), NoGil())
      .def_property_readonly("finished", [](const MeshTrainer& t) { return t.trainer.finished(); })
      .def_property_readonly("history", [](const MeshTrainer& t) { return t.trainer.history(); })
      .def(
          "epoch",
          [](MeshTrainer& t, Progress* progress, const std::array<double, 2>& part) {
            return t.trainer.epoch(part_of(progress, "training", part));
          },
          py::arg("progress") = nullptr, py::arg("part") = std::array{0.0, 1.0}, NoGil())
      .def("networks",
           [](const MeshTrainer& t) {
             return std::make_shared<MatchNetworks>(t.trainer.networks());
           })
      .def("state", [](const MeshTrainer& t) { return t.trainer.state(); })
      .def(
          "restore",
          [](MeshTrainer& t, const Tensors& state, std::vector<JointEpoch> history) {
            t.trainer.restore(state, std::move(history));
          },
          py::arg("state"), py::arg("history"));

  py::class_<MatchOptions>(module, "MatchOptions")
      .def(py::init<>())
      .def_readwrite("training", &MatchOptions::training)
      .def_readwrite("functions", &MatchOptions::functions)
      .def_readwrite("most_pairs", &MatchOptions::most_pairs)
      .def_readwrite("automatic", &MatchOptions::automatic)
      .def_readwrite("refine", &MatchOptions::refine);

  py::class_<MatchResult>(module, "MatchResult")
      .def_readonly("initial", &MatchResult::initial)
      .def_readonly("automatic", &MatchResult::automatic)
      .def_readonly("refined", &MatchResult::refined);

  py::class_<Matcher, std::shared_ptr<Matcher>>(module, "Matcher")
      .def(py::init([](std::shared_ptr<PreparedMesh> source, std::shared_ptr<PreparedMesh> target,
                       const MatchNetworks& networks, const MatchOptions& options,
                       Progress* progress) {
             return std::make_shared<Matcher>(std::move(source), std::move(target), networks,
                                              options,
                                              range(progress).stage("factoring", 0.0, 1.0));
           }),
           py::arg("source"), py::arg("target"), py::arg("networks"), py::arg("options"),
           py::arg("progress") = nullptr, NoGil())
      .def_property_readonly("history", &Matcher::history)
      .def_property_readonly("notes", &Matcher::notes)
      .def("networks",
           [](const Matcher& m) { return std::make_shared<MatchNetworks>(m.networks()); })
      .def(
          "features_map",
          [](const Matcher& m, Progress* progress) { return m.features_map(range(progress)); },
          py::arg("progress") = nullptr, NoGil())
      .def(
          "adapt",
          [](Matcher& m, const std::function<void(const JointEpoch&)>& watch, Progress* progress) {
            m.adapt(range(progress), watch);
          },
          py::arg("watch") = nullptr, py::arg("progress") = nullptr, NoGil())
      .def(
          "run",
          [](Matcher& m, const std::function<void(const JointEpoch&)>& watch, Progress* progress) {
            return m.run(range(progress), watch);
          },
          py::arg("watch") = nullptr, py::arg("progress") = nullptr, NoGil());
}

}  // namespace supple::bindings
