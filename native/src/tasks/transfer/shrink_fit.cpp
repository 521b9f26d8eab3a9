// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <memory>
#include <string>

#include "supple/core/error.h"
#include "supple/geometry/jacobians.h"
#include "supple/geometry/mesh.h"
#include "supple/geometry/operators.h"
#include "supple/geometry/sparse_cholesky.h"
#include "supple/geometry/surface_operators.h"
#include "supple/spectral/recovery.h"
#include "supple/tasks/metrics.h"
#include "supple/tasks/transfer.h"
#include "tasks/transfer/islands.h"

namespace supple {
namespace {

// A vertex looks for faces within 60 degrees of its normal.
constexpr double kAgree = 0.5;
// How much farther than the nearest point one that faces the same way may be, in mean edges.
constexpr double kReach = 2.0;
// Weight of a vertex without a partner: only to keep the system definite.
constexpr double kLeast = 1e-6;

void check(const ShrinkFitOptions& options) {
  if (options.rounds < 1 || !(options.first > 0.0) || !(options.growth >= 1.0) ||
      !std::isfinite(options.first) || !std::isfinite(options.growth)) {
    throw Error(ErrorCode::bad_option,
                "Shrink-fit needs at least 1 round, a first pull above 0 and a growth of at least "
                "1; not " +
                    std::to_string(options.rounds) + ", " + std::to_string(options.first) +
                    " and " + std::to_string(options.growth) + ".");
  }
}

// Points that are known, and between them a membrane: the known ones' weights pull, the others'
// don't.
Points filled(const SurfaceOperators& source, const Points& known, const Eigen::VectorXd& weight,
              const std::shared_ptr<const SymbolicCholesky>& symbolic) {
  constexpr double kStrong = 1e6;
  RecoveryOptions options;
  options.pull = kStrong;
  return EmbeddingRecovery(source.laplacian, weight, source.divergence, options, symbolic)
      .solve(known, MatrixField::Zero(source.faces.rows(), 9));
}

// Jacobians of a fit, without what is smaller than a ring of faces: m x 9.
MatrixField smoothed_jacobians(const SurfaceOperators& source, const Points& fit) {
  const MatrixField at_vertices = source.average * source.jacobians_of(fit);
  return average_vertices_to_faces<double>(source.faces, at_vertices);
}

// Vertices go back to `before` until no face looks away from where it looked there; a ring more of
// a bad face each round.
void keep_from_turning(const Faces& faces, const Points& before, Points& after) {
  constexpr int kRounds = 10;
  const Points normals = face_normals(before, faces);
  for (int round = 0; round < kRounds; ++round) {
    const Points now = face_normals(after, faces);
    bool any = false;
    for (Eigen::Index f = 0; f < faces.rows(); ++f) {
      if (now.row(f).dot(normals.row(f)) <= 0.0) {
        for (int c = 0; c < 3; ++c) {
          any = any || after.row(faces(f, c)) != before.row(faces(f, c));
          after.row(faces(f, c)) = before.row(faces(f, c));
        }
      }
    }
    if (!any) {
      return;
    }
  }
}

}  // namespace

ShrinkFit shrink_fit(const MeshView& source_view, const MeshView& target, const SurfaceMap& map,
                     const ShrinkFitOptions& options, ProgressRange progress) {
  check(options);
  check_surface_map(map, source_view.vertices.rows(), target.faces);
  const TriangleMesh mesh(source_view.vertices, source_view.faces);
  const SurfaceOperators source(mesh);
  const TriangleMesh goal(target.vertices, target.faces);
  const ClosestSurfacePoints surface(goal.surface_vertices(), goal.surface_faces());
  const auto symbolic = std::make_shared<const SymbolicCholesky>(source.laplacian);
  const Eigen::Index n = mesh.mesh_vertex().size();

  // Both in the target's surface units, so that a pull means the same for any two sizes.
  const Points mapped = goal.to_surface(apply(map, target.faces, target.vertices));
  Points aim(n, 3);
  Eigen::VectorXd weight(n);
  Eigen::Array<bool, Eigen::Dynamic, 1> known(n);
  bool any_known = false;
  for (Eigen::Index i = 0; i < n; ++i) {
    const int v = mesh.mesh_vertex()[i];
    aim.row(i) = mapped.row(v);
    weight[i] = source.mass[i] * (map.face[v] >= 0 ? 1.0 : kLeast);
    known[i] = map.face[v] >= 0;
    any_known = any_known || known[i];
  }
  if (!any_known) {
    throw Error(ErrorCode::bad_option,
                "The map gives no vertex of the source's surface a partner on the target.");
  }
  if (!known.all()) {
    const Points between = filled(source, aim, weight, symbolic);
    for (Eigen::Index i = 0; i < n; ++i) {
      if (!known[i]) {
        aim.row(i) = between.row(i);
      }
    }
  }
  const double reach = kReach * mean_edge(source.vertices, source.faces);
  const auto projected = [&](const Points& fit) {
    const auto found = surface.query(fit, vertex_normals(fit, source.faces), kAgree, reach);
    return apply(found.map, goal.surface_faces(), goal.surface_vertices());
  };

  Points fit = aim;
  double pull = options.first;
  for (int round = 0; round < options.rounds; ++round) {
    progress.report(static_cast<double>(round) / options.rounds);
    RecoveryOptions recovery;
    recovery.pull = pull * (round == 0 ? weight.sum() / source.mass.sum() : 1.0);
    const EmbeddingRecovery embedding(source.laplacian, round == 0 ? weight : source.mass,
                                      source.divergence, recovery, symbolic);
    fit = embedding.solve(round == 0 ? aim : projected(fit), smoothed_jacobians(source, fit));
    pull *= options.growth;
  }
  if (options.project) {
    Points after = projected(fit);
    keep_from_turning(source.faces, fit, after);
    fit = std::move(after);
  }
  ShrinkFit result;
  // The target's units; what is on no face of the source follows as it does in any deformation.
  const Points scattered = mesh.scatter(fit, source.average * source.jacobians_of(fit));
  result.vertices = goal.from_surface(mesh.to_surface(scattered));
  result.distance = ClosestSurfacePoints(target.vertices, target.faces)
                        .query(result.vertices)
                        .squared_distance.cwiseSqrt();
  result.flipped = flipped_faces(source.vertices, source.faces, fit);
  result.unmapped = count_unmapped(map.face);
  progress.report(1.0);
  return result;
}

}  // namespace supple
