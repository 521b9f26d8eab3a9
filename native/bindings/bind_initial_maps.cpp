// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings.h"
#include "supple/spectral/functional_map.h"
#include "supple/tasks/initial_map.h"

namespace supple::bindings {

void bind_initial_maps(py::module_& module) {
  py::class_<MapScore>(module, "MapScore")
      .def_readonly("orientation", &MapScore::orientation)
      .def_readonly("smoothness", &MapScore::smoothness)
      .def_readonly("area", &MapScore::area)
      .def_property_readonly("value", &MapScore::value);

  py::class_<InitialMap>(module, "InitialMap")
      .def_readonly("point_map", &InitialMap::point_map)
      .def_readonly("score", &InitialMap::score)
      .def_readonly("notes", &InitialMap::notes);

  module.def("map_score", &map_score, py::arg("source"), py::arg("target"), py::arg("point_map"),
             NoGil());
  module.def(
      "landmark_map",
      [](const PreparedMesh& source, const PreparedMesh& target, const Eigen::VectorXi& from,
         const Eigen::VectorXi& to,
         Progress* progress) { return landmark_map(source, target, from, to, range(progress)); },
      py::arg("source"), py::arg("target"), py::arg("source_landmarks"),
      py::arg("target_landmarks"), py::arg("progress") = nullptr, NoGil());
  module.def(
      "nearest_map",
      [](const PreparedMesh& source, const PreparedMesh& target, bool aligned, Progress* progress) {
        return nearest_map(source, target, aligned, range(progress));
      },
      py::arg("source"), py::arg("target"), py::arg("aligned") = false,
      py::arg("progress") = nullptr, NoGil());
  module.def("uv_map", &uv_map, py::arg("source"), py::arg("target"), py::arg("source_uvs"),
             py::arg("target_uvs"), NoGil());
  module.def(
      "automatic_map",
      [](const PreparedMesh& source, const PreparedMesh& target, Progress* progress) {
        return automatic_map(source, target, range(progress));
      },
      py::arg("source"), py::arg("target"), py::arg("progress") = nullptr, NoGil());
  module.def(
      "zoomout_map",
      [](const PreparedMesh& source, const PreparedMesh& target, const Eigen::VectorXi& map,
         int from, int to, int step, bool sampled, Progress* progress) {
        return zoomout_map(source, target, map, {.from = from, .to = to, .step = step}, sampled,
                           range(progress));
      },
      py::arg("source"), py::arg("target"), py::arg("point_map"), py::arg("start"), py::arg("end"),
      py::arg("step"), py::arg("sampled"), py::arg("progress") = nullptr, NoGil());
}

}  // namespace supple::bindings
