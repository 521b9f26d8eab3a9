// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings.h"
#include "supple/geometry/jacobians.h"
#include "supple/geometry/mesh.h"
#include "supple/geometry/operators.h"
#include "supple/spectral/eigenbasis.h"

namespace supple::bindings {

void bind_geometry(py::module_& module) {
  py::class_<Note>(module, "Note")
      .def_readonly("code", &Note::code)
      .def_readonly("count", &Note::count)
      .def_readonly("message", &Note::message);

  py::class_<TriangleMesh>(module, "TriangleMesh")
      .def(py::init<Points, Faces>(), py::arg("vertices"), py::arg("faces"))
      .def_property_readonly("notes", &TriangleMesh::notes);

  module.def("cotan_laplacian", &cotan_laplacian, py::arg("vertices"), py::arg("faces"), NoGil());
  module.def("lumped_mass", &lumped_mass, py::arg("vertices"), py::arg("faces"), NoGil());
  module.def("gradient", &gradient, py::arg("vertices"), py::arg("faces"), NoGil());
  module.def("face_areas", &face_areas, py::arg("vertices"), py::arg("faces"), NoGil());
  module.def(
      "jacobians",
      [](const Points& rest, const Faces& faces, const Points& moved) {
        return jacobians(inverse_frames(face_frames(rest, faces)), moved, faces);
      },
      py::arg("rest"), py::arg("faces"), py::arg("moved"), NoGil());
  module.def("closest_rotations", &closest_rotations, py::arg("jacobians"), NoGil());
  module.def(
      "eigenbasis",
      [](const Points& vertices, const Faces& faces, int count, Progress* progress) {
        const Eigenbasis basis =
            eigenbasis(cotan_laplacian(vertices, faces), lumped_mass(vertices, faces),
                       {.count = count}, range(progress));
        return std::make_tuple(basis.functions, basis.values, basis.residual);
      },
      py::arg("vertices"), py::arg("faces"), py::arg("count"), py::arg("progress") = nullptr,
      NoGil());
}

}  // namespace supple::bindings
