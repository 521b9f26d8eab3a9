// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "supple/core/error.h"
#include "supple/geometry/jacobians.h"
#include "supple/geometry/mesh.h"
#include "supple/geometry/nearest.h"
#include "supple/geometry/operators.h"
#include "supple/geometry/sparse_cholesky.h"
#include "supple/geometry/surface_operators.h"
#include "supple/spectral/recovery.h"
#include "supple/tasks/transfer.h"
#include "tasks/transfer/islands.h"

namespace supple {
namespace {

using Vector = Eigen::RowVector3d;

// Pull in place, times the source's vertices in 1 / area: what is smaller than about one edge of
// the source (as a wavelength) follows the interpolated Jacobians, all else the positions.
constexpr double kPullInPlace = 20.0;
// Pull in each one's own frame: of what is larger than an eighth of the surface, and there mostly
// where the key hardly moves. Elsewhere the Jacobians decide: a longer arm swings farther.
constexpr double kPullInFrames = 60.0;
constexpr double kHardlyMoves = 0.02;  // of the largest displacement
// Frames are averaged over a thirtieth of the surface.
constexpr double kFramePull = 1000.0;
// Share of the pull that keeps the system definite where nothing is known.
constexpr double kLeast = 1e-4;

struct Similarity {
  double scale = 1.0;
  Matrix3 rotation = Matrix3::Identity();
  Vector offset = Vector::Zero();

  Points operator()(const Points& p) const { return (scale * p * rotation).rowwise() + offset; }
};

// The least mass-weighted |similarity(from) - to|^2. Source: Umeyama 1991.
Similarity fitted(const Points& from, const Points& to, const Eigen::VectorXd& mass) {
  const Vector from_centre = mass.transpose() * from / mass.sum();
  const Vector to_centre = mass.transpose() * to / mass.sum();
  const Points a = from.rowwise() - from_centre, b = to.rowwise() - to_centre;
  const Matrix3 covariance = a.transpose() * mass.asDiagonal() * b;
  Similarity result;
  result.rotation = closest_rotation(covariance);
  const double size = mass.dot(a.rowwise().squaredNorm());
  result.scale = size > 0.0 ? (result.rotation.transpose() * covariance).trace() / size : 1.0;
  result.offset = to_centre - result.scale * from_centre * result.rotation;
  return result;
}

double rms(const Points& a, const Points& b, const Eigen::VectorXd& mass) {
  return std::sqrt(mass.dot((a - b).rowwise().squaredNorm()) / mass.sum());
}

// The source's side: displacements and Jacobians at its vertices.
class SourceShape {
 public:
  explicit SourceShape(const MeshView& view) : mesh(view.vertices, view.faces) {
    const Faces& faces = mesh.faces();
    Faces surface(mesh.mesh_face().size(), 3);
    for (Eigen::Index i = 0; i < surface.rows(); ++i) {
      surface.row(i) = faces.row(mesh.mesh_face()[i]);
    }
    surface_faces_ = std::move(surface);
    inverse_ = inverse_frames(face_frames(mesh.vertices(), surface_faces_));
    average_ =
        average_faces_to_vertices(surface_faces_, mesh.vertices().rows(), AveragingWeights::area,
                                  face_areas(mesh.vertices(), surface_faces_));
  }

  // n x 9, J - 1 of each vertex. An average of averages is smoother than the faces' own; one step
  // of correction gives back most of what it loses.
  MatrixField vertex_strains(const Points& moved) const {
    MatrixField strain = jacobians(inverse_, moved, surface_faces_);
    const Eigen::Map<const Eigen::Matrix<double, 1, 9>> one(kIdentity.data());
    strain.rowwise() -= one;
    MatrixField at_vertices = average_ * strain;
    const MatrixField lost =
        strain - MatrixField(average_vertices_to_faces<double>(surface_faces_, at_vertices));
    at_vertices += average_ * lost;
    return at_vertices;
  }

  TriangleMesh mesh;

 private:
  static inline const Matrix3 kIdentity = Matrix3::Identity();
  Faces surface_faces_;
  MatrixField inverse_;
  SparseRowMatrix average_;
};

// The map of the target's surface vertices; those without a partner have their nearest one's.
struct SurfacePartners {
  SurfaceMap map;
  std::vector<bool> known;
};

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

// n x 9 rotations from the target's directions at each vertex to the source's there.
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

class ShapeTransfer {
 public:
  ShapeTransfer(const MeshView& source, const MeshView& target, const SurfaceMap& map)
      : source_(source), target_mesh_(target.vertices, target.faces), target_(target_mesh_) {
    check_surface_map(map, target.vertices.rows(), source.faces);
    partners_ = partners_of(target_mesh_, map);
    symbolic_ = std::make_shared<const SymbolicCholesky>(target_.laplacian);
    const Points& rest = source_.mesh.vertices();
    const Points here = target_mesh_.from_surface(target_.vertices);
    Points there = apply(partners_.map, source.faces, rest);

    Eigen::VectorXd mass = target_.mass;
    for (Eigen::Index i = 0; i < mass.size(); ++i) {
      mass[i] *= partners_.known[i] ? 1.0 : 0.0;
    }
    const double edge = mean_edge(rest, source.faces);
    const Similarity fit = fitted(there, here, mass);
    if (rms(there, here, mass) <= edge) {
      coincide_ = true;
    } else if (fit.scale > 0.0 && rms(fit(there), here, mass) <= fit.scale * edge) {
      coincide_ = true;
      in_place_ = fit;
    }
    if (coincide_) {
      const double areas = target_mesh_.scale() / (in_place_.scale * source_.mesh.scale());
      prepare_in_place(kPullInPlace * static_cast<double>(rest.rows()) * areas * areas);
      ahead_ = here;
    } else {
      in_place_.scale = target_mesh_.scale() / source_.mesh.scale();
      frames_ = frames_along(target_, there, symbolic_);
      ahead_ = std::move(there);
    }
  }

  bool coincide() const { return coincide_; }
  Points moved(const Points& key) const;

 private:
  void prepare_in_place(double pull) {
    confidence_.setOnes(target_.mass.size());
    for (Eigen::Index i = 0; i < confidence_.size(); ++i) {
      confidence_[i] = partners_.known[i] ? 1.0 : kLeast;
    }
    recovery_ = std::make_unique<const EmbeddingRecovery>(recovery(confidence_, pull));
  }
  EmbeddingRecovery recovery(const Eigen::VectorXd& confidence, double pull) const {
    const Eigen::VectorXd mass = target_.mass.cwiseProduct(confidence);
    RecoveryOptions options;
    // The recovery scales masses to the sum 1; the pull is of the surface, whatever its confidence.
    options.pull = pull * mass.sum() / target_.mass.sum();
    return EmbeddingRecovery(target_.laplacian, mass, target_.divergence, options, symbolic_);
  }
  // ns x 3 in the target's surface units, and n x 9 J - 1 of the target in its own directions.
  Points displacements(const Points& offsets, const MatrixField& strains) const;
  MatrixField target_strains(const MatrixField& strains) const;
  std::vector<bool> at_rest(const Points& offsets) const;

  SourceShape source_;
  TriangleMesh target_mesh_;
  SurfaceOperators target_;
  SurfacePartners partners_;
  std::shared_ptr<const SymbolicCholesky> symbolic_;
  bool coincide_ = false;
  Similarity in_place_;  // source to target units; in frames, only the scale
  Points ahead_;         // where the source's motion is read off: target vertices or partners
  MatrixField frames_;   // empty in place
  Eigen::VectorXd confidence_;
  std::unique_ptr<const EmbeddingRecovery> recovery_;  // in place: one for all keys
};

// Each corner moves the place as its own motion to first order would; their mean is exact for an
// affine motion, and in place it turns what stands off the source's surface along.
Points ShapeTransfer::displacements(const Points& offsets, const MatrixField& strains) const {
  const Points rest = in_place_(source_.mesh.vertices());
  // In frames both are still in the source's directions and units.
  const Points& corners = coincide_ ? rest : source_.mesh.vertices();
  Points result(ahead_.rows(), 3);
#pragma omp parallel for schedule(static)
  for (Eigen::Index i = 0; i < ahead_.rows(); ++i) {
    Vector sum = Vector::Zero();
    for (int c = 0; c < 3; ++c) {
      const int v = source_.mesh.faces()(partners_.map.face[i], c);
      const Vector from_corner = ahead_.row(i) - corners.row(v);
      sum += partners_.map.weights(i, c) * (offsets.row(v) + from_corner * matrix_at(strains, v));
    }
    if (!coincide_) {
      sum = in_place_.scale * sum * matrix_at(frames_, i).transpose();
    }
    result.row(i) = sum / target_mesh_.scale();
  }
  return result;
}

MatrixField ShapeTransfer::target_strains(const MatrixField& strains) const {
  MatrixField result = apply(partners_.map, source_.mesh.faces(), strains);
  if (!coincide_) {
#pragma omp parallel for schedule(static)
    for (Eigen::Index i = 0; i < result.rows(); ++i) {
      const Matrix3 frame = matrix_at(frames_, i);
      matrix_at(result, i) = (frame * matrix_at(result, i) * frame.transpose()).eval();
    }
  }
  return result;
}

// Target surface vertices whose partner's face, and all faces around it, do not move at all.
std::vector<bool> ShapeTransfer::at_rest(const Points& offsets) const {
  const Faces& faces = source_.mesh.faces();
  std::vector<bool> beside(offsets.rows(), false), result(partners_.map.size());
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    if (!offsets.row(faces(f, 0)).isZero(0.0) || !offsets.row(faces(f, 1)).isZero(0.0) ||
        !offsets.row(faces(f, 2)).isZero(0.0)) {
      for (int c = 0; c < 3; ++c) {
        beside[faces(f, c)] = true;
      }
    }
  }
  for (Eigen::Index i = 0; i < partners_.map.size(); ++i) {
    const auto corners = faces.row(partners_.map.face[i]);
    result[i] = !beside[corners[0]] && !beside[corners[1]] && !beside[corners[2]];
  }
  return result;
}

Points ShapeTransfer::moved(const Points& key) const {
  const Points difference = key - source_.mesh.vertices();
  const std::vector<bool> still = at_rest(difference);
  MatrixField strains = source_.vertex_strains(key);
  Points offsets = difference;
  if (coincide_) {
    offsets = in_place_.scale * difference * in_place_.rotation;
    const Matrix3& turn = in_place_.rotation;
    for (Eigen::Index i = 0; i < strains.rows(); ++i) {
      matrix_at(strains, i) = (turn.transpose() * matrix_at(strains, i) * turn).eval();
    }
  }
  const Points moves = displacements(offsets, strains);
  MatrixField jacobian = average_vertices_to_faces<double>(target_.faces, target_strains(strains));
  for (Eigen::Index f = 0; f < jacobian.rows(); ++f) {
    matrix_at(jacobian, f) += Matrix3::Identity();
  }

  const Points& rest = target_.vertices;
  Points result;
  if (coincide_) {
    result = recovery_->solve(rest + moves, jacobian);
  } else {
    const Eigen::VectorXd length = moves.rowwise().norm();
    const double largest = length.maxCoeff();
    if (largest == 0.0) {
      return target_mesh_.vertices();
    }
    Eigen::VectorXd confidence(length.size());
    for (Eigen::Index i = 0; i < length.size(); ++i) {
      const double ratio = length[i] / (kHardlyMoves * largest);
      confidence[i] = kLeast + (partners_.known[i] ? 1.0 / (1.0 + ratio * ratio) : 0.0);
    }
    result = recovery(confidence, kPullInFrames).solve(rest + moves, jacobian);
  }
  Points displacement = (result - rest) * target_mesh_.scale();
  for (Eigen::Index i = 0; i < displacement.rows(); ++i) {
    if (still[i]) {
      displacement.row(i).setZero();
      result.row(i) = rest.row(i);
    }
  }
  // `scatter` moves what is on no face; the others keep their own digits.
  Points vertices = target_mesh_.scatter(result, target_.average * target_.jacobians_of(result));
  for (Eigen::Index i = 0; i < displacement.rows(); ++i) {
    const int v = target_mesh_.mesh_vertex()[i];
    vertices.row(v) = target_mesh_.vertices().row(v) + displacement.row(i);
  }
  return vertices;
}

}  // namespace

TransferredShapes transfer_shape_keys(const MeshView& source, const std::vector<Points>& keys,
                                      const MeshView& target, const SurfaceMap& map,
                                      ProgressRange progress) {
  for (size_t k = 0; k < keys.size(); ++k) {
    if (keys[k].rows() != source.vertices.rows()) {
      throw Error(ErrorCode::wrong_shape,
                  "Shape key " + std::to_string(k) + " has " + std::to_string(keys[k].rows()) +
                      " vertices; the source has " + std::to_string(source.vertices.rows()) + ".");
    }
    if (!keys[k].allFinite()) {
      throw Error(ErrorCode::not_finite, "Shape key " + std::to_string(k) +
                                             " has a coordinate that is not a finite number.");
    }
  }
  progress.report(0.0);
  const ShapeTransfer transfer(source, target, map);
  TransferredShapes result{{}, transfer.coincide(), count_unmapped(map.face)};
  for (size_t k = 0; k < keys.size(); ++k) {
    progress.report(0.2 + 0.8 * static_cast<double>(k) / static_cast<double>(keys.size()));
    result.shapes.push_back(transfer.moved(keys[k]));
  }
  progress.report(1.0);
  return result;
}

}  // namespace supple
