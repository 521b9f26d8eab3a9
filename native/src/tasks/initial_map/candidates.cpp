// SPDX-License-Identifier: GPL-3.0-or-later
#include "tasks/initial_map/candidates.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "supple/core/error.h"
#include "supple/geometry/jacobians.h"
#include "supple/geometry/nearest.h"
#include "supple/geometry/operators.h"
#include "supple/spectral/functional_map.h"
#include "supple/spectral/sampling.h"
#include "tasks/refine/pair.h"

namespace supple::initial_maps {
namespace {

constexpr Eigen::Index kJudged = 60;
constexpr Eigen::Index kAlignedSamples = 400;
constexpr int kAlignmentRounds = 15;
constexpr double kMirrored = 0.3;

Eigen::VectorXi samples_of(const PreparedMesh& mesh, Eigen::Index count,
                           const std::vector<int>& extra) {
  const Eigen::VectorXi spread = farthest_point_samples(mesh.operators.vertices, count);
  Eigen::VectorXi all(spread.size() + static_cast<Eigen::Index>(extra.size()));
  all << spread, Eigen::Map<const Eigen::VectorXi>(extra.data(), all.size() - spread.size());
  return all;
}

template <int Part>
std::vector<int> parts(const std::vector<std::pair<int, int>>& pairs) {
  std::vector<int> result;
  for (const auto& pair : pairs) {
    result.push_back(std::get<Part>(pair));
  }
  return result;
}

// Columns: the principal axes by area, a right-handed frame.
Matrix3 principal_axes(const SurfaceOperators& surface) {
  const Points& v = surface.vertices;
  const Matrix3 covariance = v.transpose() * surface.mass.asDiagonal() * v;
  Matrix3 axes = Eigen::SelfAdjointEigenSolver<Matrix3>(covariance).eigenvectors();
  if (axes.determinant() < 0.0) {
    axes.col(0) *= -1.0;
  }
  return axes;
}

// The 24 rotations of a cube.
std::vector<Matrix3> cube_rotations() {
  std::vector<Matrix3> result;
  std::array<int, 3> order = {0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      Matrix3 m = Matrix3::Zero();
      for (int i = 0; i < 3; ++i) {
        m(i, order[static_cast<size_t>(i)]) = (signs >> i & 1) != 0 ? -1.0 : 1.0;
      }
      if (m.determinant() > 0.0) {
        result.push_back(m);
      }
    }
  } while (std::next_permutation(order.begin(), order.end()));
  return result;
}

}  // namespace

MeshPair::MeshPair(const PreparedMesh& source_mesh, const PreparedMesh& target_mesh,
                   const std::vector<std::pair<int, int>>& extra, Eigen::Index samples)
    : source(source_mesh),
      target(target_mesh),
      count(std::min({kJudged, source.basis.size(), target.basis.size()})),
      source_samples(samples_of(source, samples, parts<0>(extra))),
      target_samples(samples_of(target, 2 * samples, parts<1>(extra))),
      source_functions(sampled_functions(source.basis, source_samples, count)),
      target_functions(sampled_functions(target.basis, target_samples, count)) {}

MapScore MeshPair::score(const RowMatrix<double>& map, const Eigen::VectorXi& places,
                         const Eigen::VectorXi& images) const {
  const RowMatrix<double> target_shape =
      target.basis.coefficients(target.operators.vertices, map.cols());
  const RowMatrix<double> pulled = map * target_shape;
  const Points source_normals = vertex_normals(source.basis.expand(pulled), source.operators.faces);
  const Points target_normals =
      vertex_normals(target.basis.expand(target_shape), target.operators.faces);
  MapScore score;
  for (Eigen::Index i = 0; i < places.size(); ++i) {
    score.orientation +=
        std::max(0.0, source_normals.row(places[i]).dot(target_normals.row(images[i])));
  }
  score.orientation /= static_cast<double>(std::max<Eigen::Index>(1, places.size()));
  const auto energy = [](const RowMatrix<double>& shape, const Eigenbasis& basis) {
    return (basis.values.head(shape.rows()).asDiagonal() * shape.cwiseAbs2()).sum();
  };
  const double here = energy(pulled, source.basis), there = energy(target_shape, target.basis);
  if (here > 0.0 && there > 0.0) {
    score.smoothness = std::sqrt(std::min(here, there) / std::max(here, there));
  }
  RowMatrix<double> product = map.transpose() * map;
  product.diagonal().array() -= 1.0;
  const auto k = static_cast<double>(map.cols());
  score.area = k / (k + product.squaredNorm());
  return score;
}

MapScore MeshPair::score(const RowMatrix<double>& map) const {
  const Eigen::VectorXi rows = sampled_point_map(source_functions, target_functions, map);
  return score(map, source_samples, target_samples(rows));
}

InitialMap MeshPair::finished(const RowMatrix<double>& map, ProgressRange progress) const {
  return finished(point_map(source.basis, target.basis, map, progress));
}

InitialMap MeshPair::finished(const Eigen::VectorXi& surface_map) const {
  InitialMap result;
  result.point_map =
      refining::from_surfaces(target.mesh, refining::surface_anchor(source.mesh), surface_map);
  result.score = score(functional_map(source.basis, target.basis, surface_map, count, count),
                       source_samples, surface_map(source_samples));
  if (result.score.orientation < kMirrored) {
    result.notes.push_back({"mirrored", 1,
                            "The map turns the surface inside out in most places. Left and right "
                            "are probably exchanged, or one mesh's faces point inwards."});
  }
  return result;
}

Alignment closest_motion(const Points& from, const Points& to) {
  const Eigen::RowVector3d a = from.colwise().mean(), b = to.colwise().mean();
  const Matrix3 covariance = (from.rowwise() - a).transpose() * (to.rowwise() - b);
  MatrixField flat(1, 9);
  matrix_at(flat, 0) = covariance;
  const MatrixField rotation = closest_rotations(flat);
  Alignment result;
  result.rotation = matrix_at(rotation, 0);
  result.shift = b - a * result.rotation;
  return result;
}

std::vector<Alignment> alignments(const MeshPair& pair) {
  const auto spread = [](const PreparedMesh& mesh) {
    return Points(mesh.operators.vertices(
        farthest_point_samples(mesh.operators.vertices, kAlignedSamples), Eigen::all));
  };
  const Points source = spread(pair.source), target = spread(pair.target);
  const NearestPoints near_source(source), near_target(target);
  const Matrix3 from = principal_axes(pair.source.operators),
                to = principal_axes(pair.target.operators);
  std::vector<Alignment> found;
  for (const Matrix3& turn : cube_rotations()) {
    Alignment now{from * turn * to.transpose(), Eigen::RowVector3d::Zero(), 0.0};
    for (int round = 0; round <= kAlignmentRounds; ++round) {
      const auto there = near_target.query((source * now.rotation).rowwise() + now.shift);
      const auto back =
          near_source.query((target.rowwise() - now.shift) * now.rotation.transpose());
      now.residual = there.squared_distance.mean() + back.squared_distance.mean();
      if (round == kAlignmentRounds) {
        break;
      }
      Points a(source.rows() + target.rows(), 3), b(a.rows(), 3);
      a << source, source(back.index, Eigen::all);
      b << target(there.index, Eigen::all), target;
      const double residual = now.residual;
      now = closest_motion(a, b);
      now.residual = residual;
    }
    found.push_back(now);
  }
  std::stable_sort(found.begin(), found.end(), [](const Alignment& a, const Alignment& b) {
    return a.residual < b.residual * (1.0 - 1e-9);
  });
  return found;
}

Eigen::VectorXi nearest_vertices(const MeshPair& pair, const Alignment& alignment) {
  return NearestPoints(pair.target.operators.vertices)
      .query((pair.source.operators.vertices * alignment.rotation).rowwise() + alignment.shift)
      .index;
}

void add_descriptors(const MeshPair& pair, Eigen::Index functions, RowMatrix<double> source,
                     RowMatrix<double> target, double weight, MapConstraints& constraints) {
  for (Eigen::Index j = 0; j < source.cols(); ++j) {
    const double size = std::sqrt((pair.source.basis.mass.dot(source.col(j).cwiseAbs2()) +
                                   pair.target.basis.mass.dot(target.col(j).cwiseAbs2())) /
                                  2.0);
    const double scale = size > 0.0 ? weight / size : 0.0;
    source.col(j) *= scale;
    target.col(j) *= scale;
  }
  const auto append = [](RowMatrix<double>& to, const RowMatrix<double>& columns) {
    RowMatrix<double> all(columns.rows(), to.cols() + columns.cols());
    if (to.cols() > 0) {
      all.leftCols(to.cols()) = to;
    }
    all.rightCols(columns.cols()) = columns;
    to = std::move(all);
  };
  append(constraints.source, pair.source.basis.coefficients(source, functions));
  append(constraints.target, pair.target.basis.coefficients(target, functions));
}

void add_operators(const MeshPair& pair, Eigen::Index functions, const RowMatrix<double>& source,
                   const RowMatrix<double>& target, Eigen::Index every,
                   MapConstraints& constraints) {
  for (Eigen::Index j = every / 2; j < source.cols(); j += every) {
    constraints.operators.emplace_back(
        orientation_operator(pair.source.basis, pair.source.operators.faces, source.col(j),
                             functions),
        orientation_operator(pair.target.basis, pair.target.operators.faces, target.col(j),
                             functions));
  }
}

}  // namespace supple::initial_maps
