// SPDX-License-Identifier: GPL-3.0-or-later
#include <pybind11/stl/filesystem.h>

#include "bindings.h"
#include "supple/tasks/map_file.h"
#include "supple/tasks/transfer.h"

namespace supple::bindings {
namespace {

using Result = ClosestSurfacePoints::Result;

std::tuple<SurfaceMap, Eigen::VectorXd, Eigen::Array<bool, Eigen::Dynamic, 1>> parts(Result found) {
  return {std::move(found.map), std::move(found.squared_distance), std::move(found.agrees)};
}

}  // namespace

void bind_transfer(py::module_& module) {
  module.def(
      "closest_points",
      [](const Points& vertices, const Faces& faces, const Points& points,
         const std::optional<Points>& normals, double cos_limit, double reach) {
        const ClosestSurfacePoints surface(vertices, faces);
        return parts(normals ? surface.query(points, *normals, cos_limit, reach)
                             : surface.query(points));
      },
      py::arg("vertices"), py::arg("faces"), py::arg("points"), py::arg("normals"),
      py::arg("cos_limit"), py::arg("reach"), NoGil());
  module.def(
      "reversed_map",
      [](const SurfaceMap& map, const Points& from_vertices, const Faces& from_faces,
         const Points& to_vertices, const Faces& to_faces) {
        return reversed(map, {from_vertices, from_faces}, {to_vertices, to_faces});
      },
      py::arg("map"), py::arg("from_vertices"), py::arg("from_faces"), py::arg("to_vertices"),
      py::arg("to_faces"), NoGil());
  module.def(
      "within_islands",
      [](const SurfaceMap& map, const Points& vertices, const Faces& faces,
         const Faces& target_faces, double majority) {
        IslandMap held = within_islands(map, {vertices, faces}, target_faces, majority);
        return std::make_tuple(std::move(held.map), held.islands, held.moved);
      },
      py::arg("map"), py::arg("vertices"), py::arg("faces"), py::arg("target_faces"),
      py::arg("majority"), NoGil());

  module.def(
      "transfer_field",
      [](const SurfaceMap& map, const Faces& source_faces, const RowMatrix<double>& field,
         double otherwise) {
        TransferredField result = transfer_field(map, source_faces, field, otherwise);
        return std::make_pair(std::move(result.values), result.unmapped);
      },
      py::arg("map"), py::arg("source_faces"), py::arg("field"), py::arg("otherwise"), NoGil());
  module.def(
      "transfer_groups",
      [](const SurfaceMap& map, const Points& vertices, const Faces& faces,
         const Faces& target_faces, const RowMatrix<double>& weights, double smallest,
         double majority) {
        TransferredGroups result =
            transfer_groups(map, {vertices, faces}, target_faces, weights, {smallest, majority});
        return std::make_tuple(std::move(result.weights), result.normalised, result.unmapped,
                               result.moved);
      },
      py::arg("map"), py::arg("vertices"), py::arg("faces"), py::arg("target_faces"),
      py::arg("weights"), py::arg("smallest"), py::arg("majority"), NoGil());
  module.def(
      "transfer_corners",
      [](const SurfaceMap& map, const Points& vertices, const Faces& faces,
         const Faces& target_faces, const RowMatrix<double>& corners, double tolerance,
         bool extrapolate, double otherwise) {
        TransferredField result = transfer_corners(map, {vertices, faces}, target_faces, corners,
                                                   {tolerance, extrapolate}, otherwise);
        return std::make_pair(std::move(result.values), result.unmapped);
      },
      py::arg("map"), py::arg("vertices"), py::arg("faces"), py::arg("target_faces"),
      py::arg("corners"), py::arg("tolerance"), py::arg("extrapolate"), py::arg("otherwise"),
      NoGil());

  module.def(
      "transfer_shape_keys",
      [](const Points& source_vertices, const Faces& source_faces, const std::vector<Points>& keys,
         const Points& target_vertices, const Faces& target_faces, const SurfaceMap& map,
         Progress* progress) {
        TransferredShapes result = transfer_shape_keys(
            {source_vertices, source_faces}, keys, {target_vertices, target_faces}, map,
            range(progress).stage("shape keys", 0.0, 1.0));
        return std::make_tuple(std::move(result.shapes), result.coincide, result.unmapped);
      },
      py::arg("source_vertices"), py::arg("source_faces"), py::arg("keys"),
      py::arg("target_vertices"), py::arg("target_faces"), py::arg("map"),
      py::arg("progress") = nullptr, NoGil());
  module.def(
      "shrink_fit",
      [](const Points& source_vertices, const Faces& source_faces, const Points& target_vertices,
         const Faces& target_faces, const SurfaceMap& map, int rounds, bool project,
         Progress* progress) {
        ShrinkFitOptions options;
        options.rounds = rounds;
        options.project = project;
        ShrinkFit result =
            shrink_fit({source_vertices, source_faces}, {target_vertices, target_faces}, map,
                       options, range(progress).stage("shrink-fit", 0.0, 1.0));
        return std::make_tuple(std::move(result.vertices), std::move(result.distance),
                               result.flipped, result.unmapped);
      },
      py::arg("source_vertices"), py::arg("source_faces"), py::arg("target_vertices"),
      py::arg("target_faces"), py::arg("map"), py::arg("rounds") = ShrinkFitOptions().rounds,
      py::arg("project") = true, py::arg("progress") = nullptr, NoGil());

  module.def(
      "save_map",
      [](const std::filesystem::path& path, const SurfaceMap& map, const Points& source_vertices,
         const Faces& source_faces, const Points& target_vertices, const Faces& target_faces) {
        save_map(path, map, {source_vertices, source_faces}, {target_vertices, target_faces});
      },
      py::arg("path"), py::arg("map"), py::arg("source_vertices"), py::arg("source_faces"),
      py::arg("target_vertices"), py::arg("target_faces"), NoGil());
  module.def(
      "load_map",
      [](const std::filesystem::path& path, const Points& source_vertices,
         const Faces& source_faces, const Points& target_vertices, const Faces& target_faces) {
        return load_map(path, {source_vertices, source_faces}, {target_vertices, target_faces});
      },
      py::arg("path"), py::arg("source_vertices"), py::arg("source_faces"),
      py::arg("target_vertices"), py::arg("target_faces"), NoGil());
}

}  // namespace supple::bindings
