// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings.h"
#include "supple/learning/network.h"
#include "supple/learning/trainer.h"

namespace supple::bindings {
namespace {

using Tensors = std::map<std::string, RowMatrix<float>>;

template <class Scalar>
py::dict train(const std::vector<TrainingPair>& pairs, const TrainOptions& options, int max_steps,
               const py::object& on_step, Progress* progress) {
  py::list steps;
  Tensors initial, final;
  {
    const py::gil_scoped_release release;
    Trainer<Scalar> trainer(pairs, options, range(progress).stage("preparing pairs", 0.0, 0.2));
    initial = trainer.network().tensors();
    const int total =
        max_steps > 0 ? std::min(max_steps, trainer.total_steps()) : trainer.total_steps();
    const ProgressRange training = range(progress).stage("training", 0.2, 1.0);
    for (int i = 0; i < total; ++i) {
      training.report(static_cast<double>(i) / total);
      const TrainStep step = trainer.step();
      const py::gil_scoped_acquire acquire;
      py::dict row;
      row["step"] = step.step;
      row["pair"] = step.pair;
      row["eigenfunctions"] = step.eigenfunctions;
      row["suggestion"] = step.suggestion;
      row["learning_rate"] = step.learning_rate;
      row["loss"] = step.loss.total;
      row["jacobian"] = step.loss.jacobian;
      row["position"] = step.loss.position;
      row["integrated"] = step.loss.integrated;
      if (!on_step.is_none()) {
        on_step(row);
      }
      steps.append(row);
    }
    training.report(1.0);
    final = trainer.network().tensors();
  }
  py::dict result;
  result["steps"] = steps;
  result["initial"] = initial;
  result["tensors"] = final;
  return result;
}

}  // namespace

void bind_learning(py::module_& module) {
  py::class_<Architecture>(module, "Architecture")
      .def(py::init([](const std::string& config, const std::string& signal, int eigenfunctions,
                       int width) {
             return Architecture{configuration(config), signal_kind(signal), eigenfunctions, width};
           }),
           py::arg("configuration"), py::arg("signal"), py::arg("eigenfunctions") = 128,
           py::arg("width") = 256)
      .def_property_readonly("configuration",
                             [](const Architecture& a) { return to_string(a.configuration); })
      .def_property_readonly("signal", [](const Architecture& a) { return to_string(a.signal); })
      .def_readonly("eigenfunctions", &Architecture::eigenfunctions)
      .def_readonly("width", &Architecture::width)
      .def_property_readonly("inputs", [](const Architecture& a) { return a.sizes().inputs; })
      .def_property_readonly("outputs", [](const Architecture& a) { return a.sizes().outputs; });

  py::class_<LocalJacobianNetwork<float>, std::shared_ptr<LocalJacobianNetwork<float>>>(module,
                                                                                        "Network")
      .def(py::init<const Architecture&, const Tensors&>(), py::arg("architecture"),
           py::arg("tensors"))
      .def_static(
          "untrained",
          [](const Architecture& architecture, uint64_t seed) {
            return std::make_shared<LocalJacobianNetwork<float>>(architecture, seed);
          },
          py::arg("architecture"), py::arg("seed"))
      .def_property_readonly("architecture", &LocalJacobianNetwork<float>::architecture)
      .def("tensors", &LocalJacobianNetwork<float>::tensors);

  py::class_<TrainOptions>(module, "TrainOptions")
      .def(py::init<>())
      .def_readwrite("architecture", &TrainOptions::architecture)
      .def_readwrite("epochs", &TrainOptions::epochs)
      .def_readwrite("first_learning_rate", &TrainOptions::first_learning_rate)
      .def_readwrite("last_learning_rate", &TrainOptions::last_learning_rate)
      .def_property(
          "loss_weights",
          [](const TrainOptions& o) {
            return std::array<double, 3>{o.weights.jacobian, o.weights.position,
                                         o.weights.integrated};
          },
          [](TrainOptions& o, const std::array<double, 3>& w) {
            o.weights = {w[0], w[1], w[2]};
          })
      .def_readwrite("samples", &TrainOptions::samples)
      .def_readwrite("fewest_eigenfunctions", &TrainOptions::fewest_eigenfunctions)
      .def_readwrite("most_eigenfunctions", &TrainOptions::most_eigenfunctions)
      .def_readwrite("seed", &TrainOptions::seed);

  py::class_<Suggestion>(module, "Suggestion")
      .def(py::init([](const Points& vertices, const Eigen::VectorXi& held) {
             return Suggestion{vertices, held};
           }),
           py::arg("vertices"), py::arg("held"));

  py::class_<TrainingPair>(module, "TrainingPair")
      .def(py::init([](const Points& source, const Faces& faces, const Points& target,
                       const std::vector<Suggestion>& suggestions,
                       const std::vector<Eigen::VectorXi>& maps) {
             return TrainingPair{source, faces, target, suggestions, maps};
           }),
           py::arg("source"), py::arg("faces"), py::arg("target"),
           py::arg("suggestions") = std::vector<Suggestion>(),
           py::arg("maps") = std::vector<Eigen::VectorXi>());

  const auto define = [&](const char* name, auto function) {
    module.def(name, function, py::arg("pairs"), py::arg("options"), py::arg("max_steps") = 0,
               py::arg("on_step") = py::none(), py::arg("progress") = nullptr);
  };
  define("train", &train<float>);
  define("train_double", &train<double>);
}

}  // namespace supple::bindings
