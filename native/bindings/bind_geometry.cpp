// SPDX-License-Identifier: GPL-3.0-or-later
#include <optional>
#include <variant>

#include "bindings.h"
#include "supple/geometry/jacobians.h"
#include "supple/geometry/mesh.h"
#include "supple/geometry/operators.h"
#include "supple/geometry/sparse_cholesky.h"
#include "supple/geometry/surface_map.h"

namespace supple::bindings {
namespace {

// A permutation, or the name of a way to find one.
using Ordering = std::variant<std::string, Eigen::VectorXi>;

SparseCholesky factored(const SparseMatrix& matrix, const std::optional<std::string>& backend,
                        const Ordering& ordering) {
  check_symmetric(matrix);
  const CholeskyBackend with =
      backend ? cholesky_backend(*backend) : SparseCholesky::default_backend();
  const auto* const name = std::get_if<std::string>(&ordering);
  return SparseCholesky(
      matrix, name != nullptr
                  ? std::make_shared<const SymbolicCholesky>(matrix, with, cholesky_ordering(*name))
                  : std::make_shared<const SymbolicCholesky>(matrix, with,
                                                             std::get<Eigen::VectorXi>(ordering)));
}

}  // namespace

void bind_geometry(py::module_& module) {
  py::class_<Note>(module, "Note")
      .def_readonly("code", &Note::code)
      .def_readonly("count", &Note::count)
      .def_readonly("message", &Note::message);

  py::class_<TriangleMesh>(module, "TriangleMesh")
      .def(py::init<Points, Faces>(), py::arg("vertices"), py::arg("faces"))
      .def_property_readonly("notes", &TriangleMesh::notes);

  py::class_<SurfaceMap>(module, "SurfaceMap")
      .def(py::init([](Eigen::VectorXi face, Points weights) {
             return SurfaceMap{std::move(face), std::move(weights)};
           }),
           py::arg("face"), py::arg("weights"))
      .def_readonly("face", &SurfaceMap::face)
      .def_readonly("weights", &SurfaceMap::weights);
  module.def("check_surface_map", &check_surface_map, py::arg("map"), py::arg("size"),
             py::arg("target_faces"), NoGil());
  module.def("surface_map", &surface_map, py::arg("point_map"), py::arg("target_faces"),
             py::arg("target_vertices"), NoGil());
  module.def("nearest_corners", &nearest_corners, py::arg("map"), py::arg("target_faces"), NoGil());

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

  py::class_<SparseCholesky>(module, "SparseCholesky")
      .def(py::init(&factored), py::arg("matrix"), py::arg("backend") = py::none(),
           py::arg("ordering") = "automatic", NoGil())
      .def(
          "solve",
          [](const SparseCholesky& self, const RowMatrix<double>& rhs) { return self.solve(rhs); },
          py::arg("rhs"), NoGil())
      .def_property_readonly("size", &SparseCholesky::size)
      .def_property_readonly(
          "ordering",
          [](const SparseCholesky& self) -> Eigen::VectorXi { return self.symbolic().ordering(); })
      .def_property_readonly("factor_entries", &SparseCholesky::factor_entries);
}

}  // namespace supple::bindings
