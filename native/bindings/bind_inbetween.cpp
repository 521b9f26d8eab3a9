// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings.h"
#include "supple/tasks/inbetween.h"
#include "supple/tasks/motion_handles.h"

namespace supple::bindings {

void bind_inbetween(py::module_& module) {
  py::class_<Inbetween>(module, "Inbetween")
      .def(py::init([](std::shared_ptr<PreparedMesh> prepared, std::vector<Points> poses,
                       std::vector<double> times, bool smooth, Progress* progress) {
             return std::make_unique<Inbetween>(
                 std::move(prepared), std::move(poses), std::move(times), InbetweenOptions{smooth},
                 range(progress).stage("taking the poses apart", 0.0, 1.0));
           }),
           py::arg("prepared"), py::arg("poses"), py::arg("times"), py::arg("smooth") = true,
           py::arg("progress") = nullptr, NoGil())
      .def("at", &Inbetween::at, py::arg("time"), NoGil());
  module.def("propose_motion_handles", &propose_motion_handles, py::arg("prepared"),
             py::arg("moved"), py::arg("count"), py::arg("radius"), NoGil());
}

}  // namespace supple::bindings
