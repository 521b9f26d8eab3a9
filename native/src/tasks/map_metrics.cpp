// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/tasks/map_metrics.h"

#include <Eigen/Geometry>
#include <cmath>
#include <string>
#include <vector>

#include "supple/core/error.h"
#include "supple/geometry/nearest.h"
#include "supple/geometry/operators.h"

namespace supple {
namespace {

void check_map(const TriangleMesh& source, const TriangleMesh& target, const Eigen::VectorXi& map) {
  const Eigen::Index n = source.vertices().rows(), targets = target.vertices().rows();
  if (map.size() != n) {
    throw Error(ErrorCode::wrong_shape, "The map has " + std::to_string(map.size()) +
                                            " entries for " + std::to_string(n) +
                                            " source vertices; it needs one for each.");
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    if (map[i] < 0 || map[i] >= targets) {
      throw Error(ErrorCode::index_out_of_range,
                  "Entry " + std::to_string(i) + " of the map is " + std::to_string(map[i]) +
                      "; the target has " + std::to_string(targets) + " vertices (0-based).");
    }
  }
}

// Of the mesh's own vertices; zero where one has no face.
Points mesh_vertex_normals(const TriangleMesh& mesh) {
  return vertex_normals(mesh.vertices(), mesh.faces());
}

// The target's vertex of each source vertex as points.
Points images_of(const TriangleMesh& target, const Eigen::VectorXi& map) {
  return target.vertices()(map, Eigen::all);
}

}  // namespace

std::vector<GeodesicError> geodesic_errors(const Geodesics& geodesics, double area,
                                           const Eigen::VectorXi& truth,
                                           const RowMatrix<int>& images, ProgressRange progress) {
  const RowMatrix<double> lengths = geodesics.between(truth, images, progress);
  std::vector<GeodesicError> errors;
  for (Eigen::Index column = 0; column < lengths.cols(); ++column) {
    GeodesicError error;
    double sum = 0.0;
    for (const double length : lengths.col(column)) {
      if (std::isfinite(length)) {
        sum += length;
      } else {
        ++error.unreachable;
      }
    }
    const auto reached = static_cast<double>(lengths.rows() - error.unreachable);
    error.mean = 100.0 * sum / (reached * std::sqrt(area));
    errors.push_back(error);
  }
  return errors;
}

double face_inversion(const TriangleMesh& source, const TriangleMesh& target,
                      const Eigen::VectorXi& map) {
  check_map(source, target, map);
  const Points normals = mesh_vertex_normals(target);
  const Points& v = target.vertices();
  int inverted = 0;
  for (const auto& face : source.faces().rowwise()) {
    const int a = map[face[0]], b = map[face[1]], c = map[face[2]];
    const Eigen::RowVector3d normal =
        Eigen::RowVector3d(v.row(b) - v.row(a)).cross(v.row(c) - v.row(a));
    inverted += normal.dot(normals.row(a) + normals.row(b) + normals.row(c)) < 0.0 ? 1 : 0;
  }
  return 100.0 * inverted / static_cast<double>(source.faces().rows());
}

double vertex_inversion(const TriangleMesh& source, const TriangleMesh& target,
                        const Eigen::VectorXi& map) {
  check_map(source, target, map);
  const Points mapped = vertex_normals(images_of(target, map), source.faces());
  const Points own = mesh_vertex_normals(target);
  Eigen::VectorXd agreement = Eigen::VectorXd::Zero(own.rows());
  for (Eigen::Index i = 0; i < map.size(); ++i) {
    agreement[map[i]] += mapped.row(i).dot(own.row(map[i]));
  }
  return 100.0 * static_cast<double>((agreement.array() < 0.0).count()) /
         static_cast<double>(own.rows());
}

double map_dirichlet(const TriangleMesh& source, const TriangleMesh& target,
                     const Eigen::VectorXi& map) {
  check_map(source, target, map);
  // The source's Laplacian has no units, so only the target's matter.
  const Points images = images_of(target, map)(source.mesh_vertex(), Eigen::all) / target.scale();
  const SparseMatrix laplacian = cotan_laplacian(source.surface_vertices(), source.surface_faces());
  return images.cwiseProduct(laplacian * images).sum();
}

double coverage(const TriangleMesh& source, const TriangleMesh& target,
                const Eigen::VectorXi& map) {
  check_map(source, target, map);
  const Eigen::VectorXd mass = lumped_mass(target.surface_vertices(), target.surface_faces());
  Eigen::VectorXd hit = Eigen::VectorXd::Zero(mass.size());
  for (const int vertex : map) {
    if (const int on_surface = target.surface_vertex()[vertex]; on_surface >= 0) {
      hit[on_surface] = mass[on_surface];
    }
  }
  return 100.0 * hit.sum() / mass.sum();
}

double chamfer(const Points& a, const Points& b) {
  if (a.rows() == 0 || b.rows() == 0) {
    throw Error(ErrorCode::wrong_shape, "Distances between " + std::to_string(a.rows()) + " and " +
                                            std::to_string(b.rows()) +
                                            " points are asked for; both need at least one.");
  }
  if (!a.allFinite() || !b.allFinite()) {
    throw Error(ErrorCode::not_finite, "The points hold NaN or infinity.");
  }
  return NearestPoints(b).query(a).squared_distance.cwiseSqrt().mean() +
         NearestPoints(a).query(b).squared_distance.cwiseSqrt().mean();
}

}  // namespace supple
