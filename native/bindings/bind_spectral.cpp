// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings.h"
#include "supple/core/nearest_rows.h"
#include "supple/geometry/mesh.h"
#include "supple/geometry/operators.h"
#include "supple/spectral/eigenbasis.h"
#include "supple/spectral/functional_map.h"
#include "supple/spectral/recovery.h"
#include "supple/spectral/sampling.h"

namespace supple::bindings {
namespace {

Eigenbasis basis_of(RowMatrix<double> functions, Eigen::VectorXd mass) {
  Eigenbasis basis;
  basis.functions = std::move(functions);
  basis.mass = std::move(mass);
  return basis;
}

EmbeddingRecovery recovery_of(const Points& vertices, const Faces& faces, const std::string& form,
                              double pull, double point_weight, double jacobian_weight) {
  return EmbeddingRecovery(
      cotan_laplacian(vertices, faces), lumped_mass(vertices, faces),
      divergence(gradient(vertices, faces), face_areas(vertices, faces)),
      RecoveryOptions{recovery_form(form), pull, point_weight, jacobian_weight});
}

}  // namespace

void bind_spectral(py::module_& module) {
  module.def("farthest_points", &farthest_point_samples, py::arg("points"), py::arg("count"),
             NoGil());

  module.def(
      "eigenbasis",
      [](const Points& vertices, const Faces& faces, int count, const std::string& method,
         Progress* progress) {
        const Eigenbasis basis =
            eigenbasis(cotan_laplacian(vertices, faces), lumped_mass(vertices, faces),
                       {.count = count, .method = eigen_method(method)}, range(progress));
        return std::make_tuple(basis.functions, basis.values, basis.residual);
      },
      py::arg("vertices"), py::arg("faces"), py::arg("count"), py::arg("method") = "automatic",
      py::arg("progress") = nullptr, NoGil());

  const RecoveryOptions defaults;
  py::class_<EmbeddingRecovery>(module, "EmbeddingRecovery")
      .def(py::init(&recovery_of), py::arg("vertices"), py::arg("faces"),
           py::arg("form") = to_string(defaults.form), py::arg("pull") = defaults.pull,
           py::arg("point_weight") = defaults.point_weight,
           py::arg("jacobian_weight") = defaults.jacobian_weight, NoGil())
      .def("solve", &EmbeddingRecovery::solve, py::arg("coarse"), py::arg("jacobians"), NoGil())
      .def_property_readonly("factor_entries", &EmbeddingRecovery::factor_entries);

  module.def(
      "functional_map",
      [](RowMatrix<double> source, Eigen::VectorXd source_mass, RowMatrix<double> target,
         Eigen::VectorXd target_mass, const Eigen::VectorXi& map) {
        const Eigen::Index rows = source.cols(), columns = target.cols();
        return functional_map(basis_of(std::move(source), std::move(source_mass)),
                              basis_of(std::move(target), std::move(target_mass)), map, rows,
                              columns);
      },
      py::arg("source"), py::arg("source_mass"), py::arg("target"), py::arg("target_mass"),
      py::arg("point_map"), NoGil());
  module.def(
      "point_map",
      [](RowMatrix<double> source, Eigen::VectorXd source_mass, RowMatrix<double> target,
         Eigen::VectorXd target_mass, const RowMatrix<double>& map, Progress* progress) {
        return point_map(basis_of(std::move(source), std::move(source_mass)),
                         basis_of(std::move(target), std::move(target_mass)), map, range(progress));
      },
      py::arg("source"), py::arg("source_mass"), py::arg("target"), py::arg("target_mass"),
      py::arg("functional_map"), py::arg("progress") = nullptr, NoGil());
  module.def(
      "zoomout",
      [](RowMatrix<double> source, Eigen::VectorXd source_mass, RowMatrix<double> target,
         Eigen::VectorXd target_mass, const Eigen::VectorXi& initial, int from, int to, int step,
         Progress* progress) {
        Zoomout refined = zoomout(basis_of(std::move(source), std::move(source_mass)),
                                  basis_of(std::move(target), std::move(target_mass)), initial,
                                  {.from = from, .to = to, .step = step}, range(progress));
        return std::make_pair(std::move(refined.point_map), std::move(refined.functional_map));
      },
      py::arg("source"), py::arg("source_mass"), py::arg("target"), py::arg("target_mass"),
      py::arg("point_map"), py::arg("start"), py::arg("end"), py::arg("step"),
      py::arg("progress") = nullptr, NoGil());
  module.def(
      "nearest_rows",
      [](const RowMatrix<double>& queries, const RowMatrix<double>& points, Progress* progress) {
        return nearest_rows(queries, points, range(progress));
      },
      py::arg("queries"), py::arg("points"), py::arg("progress") = nullptr, NoGil());
}

}  // namespace supple::bindings
