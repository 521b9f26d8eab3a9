// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings.h"
#include "supple/geometry/geodesics.h"
#include "supple/geometry/mesh.h"
#include "supple/tasks/map_metrics.h"

namespace supple::bindings {

void bind_map_metrics(py::module_& module) {
  py::class_<Geodesics>(module, "Geodesics")
      .def(py::init<const Points&, const Faces&>(), py::arg("vertices"), py::arg("faces"), NoGil())
      .def("distances", &Geodesics::distances, py::arg("source"), NoGil())
      .def(
          "between",
          [](const Geodesics& geodesics, const Eigen::VectorXi& sources,
             const RowMatrix<int>& targets,
             Progress* progress) { return geodesics.between(sources, targets, range(progress)); },
          py::arg("sources"), py::arg("targets"), py::arg("progress") = nullptr, NoGil());
  module.def(
      "geodesic_errors",
      [](const Geodesics& geodesics, double area, const Eigen::VectorXi& truth,
         const RowMatrix<int>& images, Progress* progress) {
        std::vector<std::pair<double, int>> result;
        for (const GeodesicError& error :
             geodesic_errors(geodesics, area, truth, images, range(progress))) {
          result.emplace_back(error.mean, error.unreachable);
        }
        return result;
      },
      py::arg("geodesics"), py::arg("area"), py::arg("truth"), py::arg("images"),
      py::arg("progress") = nullptr, NoGil());
  module.def("face_inversion", &face_inversion, py::arg("source"), py::arg("target"),
             py::arg("map"), NoGil());
  module.def("vertex_inversion", &vertex_inversion, py::arg("source"), py::arg("target"),
             py::arg("map"), NoGil());
  module.def("map_dirichlet", &map_dirichlet, py::arg("source"), py::arg("target"), py::arg("map"),
             NoGil());
  module.def("coverage", &coverage, py::arg("source"), py::arg("target"), py::arg("map"), NoGil());
  module.def("chamfer", &chamfer, py::arg("a"), py::arg("b"), NoGil());
}

}  // namespace supple::bindings
