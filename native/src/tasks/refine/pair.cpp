// SPDX-License-Identifier: GPL-3.0-or-later
#include "pair.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "supple/core/error.h"
#include "supple/geometry/nearest.h"
#include "supple/geometry/operators.h"

namespace supple::refining {
namespace {

[[noreturn]] void fail(ErrorCode code, const std::string& message) { throw Error(code, message); }

void check_size(Eigen::Index given, const TriangleMesh& source) {
  if (given != source.vertices().rows()) {
    fail(ErrorCode::wrong_shape,
         "The map has " + std::to_string(given) + " entries for the " +
             std::to_string(source.vertices().rows()) +
             " vertices of the source; it must have one each. Is it a map the other way?");
  }
}

int boundary_edges(const TriangleMesh& mesh) {
  for (const Note& note : mesh.notes()) {
    if (note.code == "boundary") {
      return note.count;
    }
  }
  return 0;
}

}  // namespace

void check_options(const RefineOptions& options) {
  if (options.counts.empty() ||
      *std::min_element(options.counts.begin(), options.counts.end()) < 1) {
    fail(ErrorCode::bad_option,
         "Refining needs at least one round, and at least 1 eigenfunction in each.");
  }
  if (options.settling_rounds < 0) {
    fail(ErrorCode::bad_option,
         "There can't be " + std::to_string(options.settling_rounds) + " settling rounds.");
  }
  if (!(options.facing >= -1.0 && options.facing <= 1.0)) {
    fail(ErrorCode::bad_option, "facing is " + std::to_string(options.facing) +
                                    "; it is a cosine, from -1 (any normal) to 1.");
  }
  if (!(options.facing_reach > 0.0)) {
    fail(ErrorCode::bad_option,
         "facing_reach is " + std::to_string(options.facing_reach) + "; it must be positive.");
  }
}

std::vector<Note> pair_notes(const PreparedMesh& source, const PreparedMesh& target,
                             const RefineOptions& options) {
  std::vector<Note> notes;
  const int components = source.mesh.component_count(), others = target.mesh.component_count();
  if (components != others) {
    notes.push_back({"components_differ", std::abs(components - others),
                     "The source has " + std::to_string(components) + " pieces, the target " +
                         std::to_string(others) +
                         ": at least one piece has no partner of its own, and maps into another."});
  }
  const int edges = boundary_edges(source.mesh), other_edges = boundary_edges(target.mesh);
  if ((edges == 0) != (other_edges == 0)) {
    notes.push_back(
        {"boundaries_differ", std::max(edges, other_edges),
         std::string("Only the ") + (edges > 0 ? "source" : "target") +
             " has a boundary: what the other has there is mapped to or from its edge."});
  }
  const int wanted = *std::max_element(options.counts.begin(), options.counts.end());
  const auto there = static_cast<int>(std::min(source.basis.size(), target.basis.size()));
  if (wanted > there) {
    notes.push_back({"fewer_eigenfunctions", there,
                     "A round asks for " + std::to_string(wanted) +
                         " eigenfunctions; these meshes " + "have " + std::to_string(there) +
                         ", which are used."});
  }
  return notes;
}

Eigen::VectorXi surface_anchor(const TriangleMesh& mesh) {
  Eigen::VectorXi anchor = mesh.surface_vertex();
  std::vector<int> loose;
  for (int i = 0; i < anchor.size(); ++i) {
    if (anchor[i] < 0) {
      loose.push_back(i);
    }
  }
  if (!loose.empty()) {
    Points places(static_cast<Eigen::Index>(loose.size()), 3);
    for (Eigen::Index i = 0; i < places.rows(); ++i) {
      places.row(i) = mesh.vertices().row(loose[static_cast<size_t>(i)]);
    }
    const Eigen::VectorXi nearest =
        NearestPoints(mesh.surface_vertices()).query(mesh.to_surface(places)).index;
    for (Eigen::Index i = 0; i < places.rows(); ++i) {
      anchor[loose[static_cast<size_t>(i)]] = nearest[i];
    }
  }
  return anchor;
}

Eigen::VectorXi to_surfaces(const TriangleMesh& source, const TriangleMesh& target,
                            const Eigen::VectorXi& target_anchor, const Eigen::VectorXi& map) {
  check_size(map.size(), source);
  for (Eigen::Index i = 0; i < map.size(); ++i) {
    if (map[i] < 0 || map[i] >= target.vertices().rows()) {
      fail(ErrorCode::index_out_of_range,
           "The map leads source vertex " + std::to_string(i) + " to target vertex " +
               std::to_string(map[i]) + "; the target has " +
               std::to_string(target.vertices().rows()) + ", counted from 0.");
    }
  }
  Eigen::VectorXi result(source.mesh_vertex().size());
  for (Eigen::Index i = 0; i < result.size(); ++i) {
    result[i] = target_anchor[map[source.mesh_vertex()[i]]];
  }
  return result;
}

SurfaceMap to_surfaces(const TriangleMesh& source, const TriangleMesh& target,
                       const SurfaceMap& map) {
  check_size(map.size(), source);
  check_surface_map(map, source.vertices().rows(), target.faces());
  Eigen::VectorXi surface_face = Eigen::VectorXi::Constant(target.faces().rows(), -1);
  for (Eigen::Index f = 0; f < target.mesh_face().size(); ++f) {
    surface_face[target.mesh_face()[f]] = static_cast<int>(f);
  }
  const Eigen::Index n = source.mesh_vertex().size();
  SurfaceMap result{Eigen::VectorXi(n), Points(n, 3)};
  for (Eigen::Index i = 0; i < n; ++i) {
    const int vertex = source.mesh_vertex()[i], face = map.face[vertex];
    result.face[i] = face < 0 ? -1 : surface_face[face];
    result.weights.row(i) = map.weights.row(vertex);
    if (result.face[i] < 0) {
      fail(ErrorCode::index_out_of_range,
           "The map leads source vertex " + std::to_string(vertex) + " to " +
               (face < 0 ? "no face" : "face " + std::to_string(face) + ", which has no area") +
               ". Every vertex needs a place on the target.");
    }
  }
  return result;
}

Eigen::VectorXi from_surfaces(const TriangleMesh& target, const Eigen::VectorXi& source_anchor,
                              const Eigen::VectorXi& map) {
  Eigen::VectorXi result(source_anchor.size());
  for (Eigen::Index i = 0; i < result.size(); ++i) {
    result[i] = target.mesh_vertex()[map[source_anchor[i]]];
  }
  return result;
}

SurfaceMap from_surfaces(const TriangleMesh& target, const Eigen::VectorXi& source_anchor,
                         const SurfaceMap& map) {
  const Eigen::Index n = source_anchor.size();
  SurfaceMap result{Eigen::VectorXi(n), Points(n, 3)};
  for (Eigen::Index i = 0; i < n; ++i) {
    result.face[i] = target.mesh_face()[map.face[source_anchor[i]]];
    result.weights.row(i) = map.weights.row(source_anchor[i]);
  }
  return result;
}

Eigen::VectorXd confidence(const SurfaceOperators& source, const SurfaceOperators& target,
                           const Points& recovered, const SurfaceMap& map,
                           const Eigen::VectorXi& point_map) {
  const double fewer = static_cast<double>(std::min(source.faces.rows(), target.faces.rows()));
  const double h2 = 4.0 / fewer;
  const Points on_target = apply(map, target.faces, target.vertices);
  const Points normals = vertex_normals(recovered, source.faces);
  const Points target_vertices = target.vertices(point_map, Eigen::all);
  const Eigen::VectorXi back = NearestPoints(recovered).query(target_vertices).index;
  Eigen::VectorXd result(recovered.rows());
  for (Eigen::Index i = 0; i < result.size(); ++i) {
    const double d2 = (recovered.row(i) - on_target.row(i)).squaredNorm();
    const double r2 = (source.vertices.row(i) - source.vertices.row(back[i])).squaredNorm();
    const double facing = normals.row(i).dot(target.face_normals.row(map.face[i]));
    result[i] = std::exp(-d2 / (2.0 * h2) - r2 / (8.0 * h2)) * std::clamp(facing, 0.0, 1.0);
  }
  return result;
}

}  // namespace supple::refining
