// SPDX-License-Identifier: GPL-3.0-or-later
#include "tasks/transfer/shape_parts.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <optional>
#include <utility>

#include "supple/core/error.h"
#include "supple/geometry/jacobians.h"
#include "supple/geometry/nearest.h"
#include "supple/geometry/operators.h"

namespace supple {
namespace {

// Frames are averaged over a thirtieth of the surface.
constexpr double kFramePull = 1000.0;
// An anchor's weight: above some 1e6 its corrections hardly depend on it.
constexpr double kAnchor = 1e8;
// Where no anchor is near, corrections vanish; far below the first eigenvalue's square.
constexpr double kVanish = 1.0;
// Anchors look for faces within 70 degrees.
constexpr double kAgree = 0.34;

SparseMatrix interpolation_of(const Anchors& anchors, const Faces& faces, Eigen::Index n) {
  std::vector<Eigen::Triplet<double>> entries;
  for (Eigen::Index i = 0; i < anchors.vertex.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      entries.emplace_back(i, faces(anchors.place.face[i], c), anchors.place.weights(i, c));
    }
  }
  SparseMatrix result(anchors.vertex.size(), n);
  result.setFromTriplets(entries.begin(), entries.end());
  return result;
}

SparseMatrix corrected_system(const SurfaceOperators& target, const SparseMatrix& interpolation) {
  const Eigen::VectorXd mass = target.mass / target.mass.sum();
  const SparseMatrix scaled = mass.cwiseInverse().asDiagonal() * target.laplacian;
  SparseMatrix system = target.laplacian * scaled;
  system += SparseMatrix(kAnchor * (interpolation.transpose() * interpolation));
  for (Eigen::Index i = 0; i < system.rows(); ++i) {
    system.coeffRef(i, i) += kVanish * mass[i];
  }
  return system;
}

}  // namespace

Similarity fitted(const Points& from, const Points& to, const Eigen::VectorXd& mass) {
  const Eigen::RowVector3d from_centre = mass.transpose() * from / mass.sum();
  const Eigen::RowVector3d to_centre = mass.transpose() * to / mass.sum();
  const Points a = from.rowwise() - from_centre, b = to.rowwise() - to_centre;
  const Matrix3 covariance = a.transpose() * mass.asDiagonal() * b;
  Similarity result;
  result.rotation = closest_rotation(covariance);
  const double size = mass.dot(a.rowwise().squaredNorm());
  result.scale = size > 0.0 ? (result.rotation.transpose() * covariance).trace() / size : 1.0;
  result.offset = to_centre - result.scale * from_centre * result.rotation;
  return result;
}

SourceShape::SourceShape(const MeshView& view) : mesh(view.vertices, view.faces) {
  surface_faces_.resize(mesh.mesh_face().size(), 3);
  for (Eigen::Index i = 0; i < surface_faces_.rows(); ++i) {
    surface_faces_.row(i) = mesh.faces().row(mesh.mesh_face()[i]);
  }
  inverse_ = inverse_frames(face_frames(mesh.vertices(), surface_faces_));
  average_ =
      average_faces_to_vertices(surface_faces_, mesh.vertices().rows(), AveragingWeights::area,
                                face_areas(mesh.vertices(), surface_faces_));
}

// An average of averages is smoother than the faces' own; one step of correction gives back most of
// what it loses.
MatrixField SourceShape::vertex_strains(const Points& moved) const {
  MatrixField strain = jacobians(inverse_, moved, surface_faces_);
  const Matrix3 identity = Matrix3::Identity();
  strain.rowwise() -= Eigen::Map<const Eigen::Matrix<double, 1, 9>>(identity.data());
  MatrixField at_vertices = average_ * strain;
  const MatrixField lost =
      strain - MatrixField(average_vertices_to_faces<double>(surface_faces_, at_vertices));
  at_vertices += average_ * lost;
  return at_vertices;
}

SurfacePartners partners_of(const TriangleMesh& target, const SurfaceMap& map) {
  const Eigen::Index n = target.mesh_vertex().size();
  SurfacePartners result{{Eigen::VectorXi(n), Points(n, 3)}, std::vector<bool>(n)};
  std::vector<int> known;
  for (int i = 0; i < n; ++i) {
    result.known[i] = map.face[target.mesh_vertex()[i]] >= 0;
    if (result.known[i]) {
      known.push_back(i);
    }
  }
  if (known.empty()) {
    throw Error(ErrorCode::bad_option,
                "The map gives no vertex of the target's surface a partner; there is nothing to "
                "carry over.");
  }
  Points places(static_cast<Eigen::Index>(known.size()), 3);
  for (size_t i = 0; i < known.size(); ++i) {
    places.row(static_cast<Eigen::Index>(i)) = target.surface_vertices().row(known[i]);
  }
  std::optional<NearestPoints> nearest;
  for (int i = 0; i < n; ++i) {
    int from = i;
    if (!result.known[i]) {
      if (!nearest) {
        nearest.emplace(places);
      }
      from = known[nearest->query(target.surface_vertices().row(i)).index[0]];
    }
    const int vertex = target.mesh_vertex()[from];
    result.map.face[i] = map.face[vertex];
    result.map.weights.row(i) = map.weights.row(vertex);
  }
  return result;
}

MatrixField frames_along(const SurfaceOperators& target, const Points& partners,
                         const std::shared_ptr<const SymbolicCholesky>& symbolic) {
  // Where the map collapses a face its rows are 0 and it has no say.
  const MatrixField along = jacobians(target.inverse_frames, face_frames(partners, target.faces));
  const RowMatrix<double> at_vertices =
      average_faces_to_vertices(target.faces, target.vertices.rows(), AveragingWeights::area,
                                target.face_areas) *
      along;
  const Eigen::VectorXd mass = kFramePull * target.mass / target.mass.sum();
  SparseMatrix system = target.laplacian;
  for (Eigen::Index i = 0; i < system.rows(); ++i) {
    system.coeffRef(i, i) += mass[i];
  }
  return closest_rotations(SparseCholesky(system, symbolic).solve(mass.asDiagonal() * at_vertices));
}

Anchors anchors_of(const Points& source, const Faces& source_faces, const SurfaceOperators& target,
                   const Points& partners, const std::vector<bool>& known, double edge) {
  const auto found = ClosestSurfacePoints(target.vertices, target.faces)
                         .query(source, vertex_normals(source, source_faces), kAgree, edge);
  const Points back = apply(found.map, target.faces, partners);
  const Points on_target = apply(found.map, target.faces, target.vertices);
  std::vector<int> kept;
  for (int i = 0; i < source.rows(); ++i) {
    const auto corners = target.faces.row(found.map.face[i]);
    const bool mapped = known[corners[0]] && known[corners[1]] && known[corners[2]];
    if (mapped && (back.row(i) - source.row(i)).norm() <= 0.5 * edge) {
      kept.push_back(i);
    }
  }
  const auto count = static_cast<Eigen::Index>(kept.size());
  Anchors result{Eigen::Map<Eigen::VectorXi>(kept.data(), count),
                 {Eigen::VectorXi(count), Points(count, 3)},
                 Points(count, 3)};
  for (Eigen::Index i = 0; i < count; ++i) {
    result.place.face[i] = found.map.face[kept[i]];
    result.place.weights.row(i) = found.map.weights.row(kept[i]);
    result.gap.row(i) = source.row(kept[i]) - on_target.row(kept[i]);
  }
  return result;
}

AnchoredCorrection::AnchoredCorrection(const SurfaceOperators& target, Anchors anchors)
    : anchors_(std::move(anchors)),
      interpolation_(interpolation_of(anchors_, target.faces, target.vertices.rows())),
      factor_(corrected_system(target, interpolation_)) {}

Points AnchoredCorrection::operator()(const Points& offsets, const MatrixField& strains,
                                      const Points& displacements) const {
  Points missing = -(interpolation_ * displacements);
  for (Eigen::Index i = 0; i < anchors_.vertex.size(); ++i) {
    const int v = anchors_.vertex[i];
    missing.row(i) += offsets.row(v) - anchors_.gap.row(i) * matrix_at(strains, v);
  }
  return factor_.solve(kAnchor * (interpolation_.transpose() * missing));
}

}  // namespace supple
