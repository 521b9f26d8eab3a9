// SPDX-License-Identifier: GPL-3.0-or-later
#include "volume.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace supple {
namespace {

// Of the lost volume, this much is restored. Bodies and animals that bend lose about half of what
// an edit without it loses (muscles bulge, but skin also folds), so all of it would be too much.
constexpr double kShare = 0.7;
// No vertex goes farther than this, in roots of the area.
constexpr double kFarthest = 0.05;
// Less is no volume to keep: a sphere has 0.09.
constexpr double kLeast = 1e-5;

// How many faces at corner `from` have the edge from -> to in their order.
int faces_along(const SurfaceOperators& operators, int from, int to) {
  const CornerTable& corners = operators.corners;
  int count = 0;
  for (int i = corners.first[from]; i < corners.first[from + 1]; ++i) {
    const int f = corners.corner[i] / 3, c = corners.corner[i] - 3 * f;
    count += operators.faces(f, (c + 1) % 3) == to ? 1 : 0;
  }
  return count;
}

// t with c1 t + c2 t^2 + c3 t^3 = wanted, near 0, |t| <= most.
double root(double c1, double c2, double c3, double wanted, double most) {
  double t = 0.0;
  for (int step = 0; step < 20; ++step) {
    const double slope = c1 + t * (2.0 * c2 + t * 3.0 * c3);
    if (!(slope > 0.1 * c1)) {
      break;  // past where more movement adds volume
    }
    const double change = (wanted - t * (c1 + t * (c2 + t * c3))) / slope;
    t = std::clamp(t + change, -most, most);
    if (std::abs(change) < 1e-12 * most) {
      break;
    }
  }
  return t;
}

}  // namespace

EnclosedVolume::EnclosedVolume(const SurfaceOperators& operators) : operators_(operators) {
  Eigen::VectorXi open = Eigen::VectorXi::Zero(operators.component_count);
  for (Eigen::Index f = 0; f < operators.faces.rows(); ++f) {
    for (int c = 0; c < 3; ++c) {
      const int a = operators.faces(f, c), b = operators.faces(f, (c + 1) % 3);
      if (faces_along(operators, a, b) != 1 || faces_along(operators, b, a) != 1) {
        open[operators.component[a]] = 1;
      }
    }
  }
  at_rest_ = of(operators.vertices, gradient(operators.vertices));
  for (Eigen::Index c = 0; c < at_rest_.size(); ++c) {
    if (open[c] != 0 || !(at_rest_[c] > kLeast)) {
      at_rest_[c] = 0.0;
    }
  }
}

Eigen::VectorXd EnclosedVolume::of(const Points& moved, const Points& gradient) const {
  Eigen::VectorXd result = Eigen::VectorXd::Zero(operators_.component_count);
  for (Eigen::Index v = 0; v < moved.rows(); ++v) {  // of degree 3, so that x . gradient is 3 V
    result[operators_.component[v]] += moved.row(v).dot(gradient.row(v)) / 3.0;
  }
  return result;
}

Points EnclosedVolume::gradient(const Points& moved) const {
  const CornerTable& corners = operators_.corners;
  Points result(moved.rows(), 3);
#pragma omp parallel for schedule(static)
  for (Eigen::Index v = 0; v < result.rows(); ++v) {
    Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
    for (int i = corners.first[v]; i < corners.first[v + 1]; ++i) {
      const int f = corners.corner[i] / 3, c = corners.corner[i] - 3 * f;
      const Eigen::RowVector3d next = moved.row(operators_.faces(f, (c + 1) % 3));
      sum += next.cross(moved.row(operators_.faces(f, (c + 2) % 3)));
    }
    result.row(v) = sum / 6.0;
  }
  return result;
}

Eigen::VectorXd EnclosedVolume::in(const Points& pose) const {
  Eigen::VectorXd result = of(pose, gradient(pose));
  for (Eigen::Index c = 0; c < result.size(); ++c) {
    if (!(at_rest_[c] > 0.0 && result[c] > kLeast)) {
      result[c] = 0.0;
    }
  }
  return result;
}

std::vector<EnclosedVolume::Cubic> EnclosedVolume::along(const Points& moved,
                                                         const Points& way) const {
  // Always as many parts, so that no sum depends on the number of threads.
  constexpr Eigen::Index kParts = 16;
  const Faces& faces = operators_.faces;
  const auto pieces = static_cast<size_t>(operators_.component_count);
  // A closed surface's volume is the same from any point; from one far away little is left of it.
  const Eigen::RowVector3d centre = moved.colwise().mean();
  std::vector<std::vector<Cubic>> parts(kParts, std::vector<Cubic>(pieces));
#pragma omp parallel for schedule(static)
  for (Eigen::Index part = 0; part < kParts; ++part) {
    std::vector<Cubic>& sums = parts[static_cast<size_t>(part)];
    for (Eigen::Index f = faces.rows() * part / kParts; f < faces.rows() * (part + 1) / kParts;
         ++f) {
      const Eigen::RowVector3d a = moved.row(faces(f, 0)) - centre,
                               b = moved.row(faces(f, 1)) - centre,
                               c = moved.row(faces(f, 2)) - centre, u = way.row(faces(f, 0)),
                               v = way.row(faces(f, 1)), w = way.row(faces(f, 2));
      // (a + t u) . (b + t v) x (c + t w)
      const Eigen::RowVector3d still = b.cross(c), mixed = b.cross(w) + v.cross(c),
                               bent = v.cross(w);
      Cubic& sum = sums[static_cast<size_t>(operators_.component[faces(f, 0)])];
      sum.c[0] += a.dot(still);
      sum.c[1] += u.dot(still) + a.dot(mixed);
      sum.c[2] += u.dot(mixed) + a.dot(bent);
      sum.c[3] += u.dot(bent);
    }
  }
  std::vector<Cubic> result(pieces);
  for (const std::vector<Cubic>& sums : parts) {
    for (size_t piece = 0; piece < pieces; ++piece) {
      for (int i = 0; i < 4; ++i) {
        result[piece].c[i] += sums[piece].c[i] / 6.0;
      }
    }
  }
  return result;
}

void EnclosedVolume::restore(const Eigen::VectorXd& kept, const Points& way, Points& moved) const {
  const std::vector<Cubic> volume = along(moved, way);
  const Eigen::Index pieces = at_rest_.size();
  Eigen::VectorXd farthest = Eigen::VectorXd::Zero(pieces);
  for (Eigen::Index v = 0; v < moved.rows(); ++v) {
    double& here = farthest[operators_.component[v]];
    here = std::max(here, way.row(v).squaredNorm());
  }
  Eigen::VectorXd length = Eigen::VectorXd::Zero(pieces);
  for (Eigen::Index piece = 0; piece < pieces; ++piece) {
    const double* const c = volume[static_cast<size_t>(piece)].c;
    if (kept[piece] > 0.0 && c[1] > 0.0) {
      length[piece] = root(c[1], c[2], c[3], kShare * (kept[piece] - c[0]),
                           kFarthest / std::sqrt(farthest[piece]));
    }
  }
#pragma omp parallel for schedule(static)
  for (Eigen::Index v = 0; v < moved.rows(); ++v) {
    moved.row(v) += length[operators_.component[v]] * way.row(v);
  }
}

}  // namespace supple
