// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings.h"
#include "supple/tasks/refine.h"

namespace supple::bindings {
namespace {

using Network = LocalJacobianNetwork<float>;

RefineOptions refine_options(const std::string& method, std::vector<int> counts,
                             int settling_rounds, const std::string& form, double pull,
                             double point_weight, double jacobian_weight, double facing,
                             double facing_reach, bool backward) {
  RefineOptions options;
  options.method = refine_method(method);
  options.counts = std::move(counts);
  options.settling_rounds = settling_rounds;
  options.recovery = {recovery_form(form), pull, point_weight, jacobian_weight};
  options.facing = facing;
  options.facing_reach = facing_reach;
  options.backward = backward;
  return options;
}

}  // namespace

void bind_refine(py::module_& module) {
  const RefineOptions defaults;
  py::class_<RefineOptions>(module, "RefineOptions")
      .def(py::init(&refine_options), py::arg("method") = to_string(defaults.method),
           py::arg("counts") = defaults.counts,
           py::arg("settling_rounds") = defaults.settling_rounds,
           py::arg("form") = to_string(defaults.recovery.form),
           py::arg("pull") = defaults.recovery.pull,
           py::arg("point_weight") = defaults.recovery.point_weight,
           py::arg("jacobian_weight") = defaults.recovery.jacobian_weight,
           py::arg("facing") = defaults.facing, py::arg("facing_reach") = defaults.facing_reach,
           py::arg("backward") = defaults.backward);

  py::class_<RefineReport>(module, "RefineReport")
      .def_readonly("rounds", &RefineReport::rounds)
      .def_readonly("eigenfunctions", &RefineReport::eigenfunctions)
      .def_readonly("network", &RefineReport::network)
      .def_readonly("bounded_faces", &RefineReport::bounded_faces)
      .def_readonly("signal_milliseconds", &RefineReport::signal_milliseconds)
      .def_readonly("network_milliseconds", &RefineReport::network_milliseconds)
      .def_readonly("recovery_milliseconds", &RefineReport::recovery_milliseconds)
      .def_readonly("nearest_milliseconds", &RefineReport::nearest_milliseconds)
      .def_readonly("total_milliseconds", &RefineReport::total_milliseconds);

  py::class_<RefineResult>(module, "RefineResult")
      .def_readonly("point_map", &RefineResult::point_map)
      .def_readonly("surface_map", &RefineResult::surface_map)
      .def_readonly("recovered", &RefineResult::recovered)
      .def_readonly("confidence", &RefineResult::confidence)
      .def_readonly("backward_point_map", &RefineResult::backward_point_map)
      .def_readonly("backward_surface_map", &RefineResult::backward_surface_map)
      .def_readonly("report", &RefineResult::report);

  py::class_<Refiner, std::shared_ptr<Refiner>>(module, "Refiner")
      .def(py::init([](std::shared_ptr<PreparedMesh> source, std::shared_ptr<PreparedMesh> target,
                       std::shared_ptr<Network> network, const RefineOptions& options,
                       Progress* progress) {
             return std::make_shared<Refiner>(std::move(source), std::move(target),
                                              std::move(network), options,
                                              range(progress).stage("factoring", 0.0, 1.0));
           }),
           py::arg("source"), py::arg("target"), py::arg("network"), py::arg("options"),
           py::arg("progress") = nullptr, NoGil())
      .def(
          "refine",
          [](const Refiner& refiner, const Eigen::VectorXi& point_map, Progress* progress) {
            return refiner.refine(point_map, range(progress));
          },
          py::arg("point_map"), py::arg("progress") = nullptr, NoGil())
      .def(
          "refine",
          [](const Refiner& refiner, const SurfaceMap& map, Progress* progress) {
            return refiner.refine(map, range(progress));
          },
          py::arg("map"), py::arg("progress") = nullptr, NoGil())
      .def_property_readonly("notes", &Refiner::notes);
}

}  // namespace supple::bindings
