// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/operators.h"

#include <Eigen/Geometry>
#include <array>
#include <vector>

namespace supple {
namespace {

// Corner data of one face: edge k is opposite corner k.
struct FaceShape {
  std::array<Eigen::RowVector3d, 3> edge;
  std::array<double, 3> cotangent;
  double area = 0.0;
  Eigen::RowVector3d cross;
};

FaceShape face_shape(const Points& v, const Faces& faces, Eigen::Index f) {
  FaceShape s;
  for (int k = 0; k < 3; ++k) {
    s.edge[k] = v.row(faces(f, (k + 2) % 3)) - v.row(faces(f, (k + 1) % 3));
  }
  s.cross = s.edge[0].cross(s.edge[1]);
  const double twice_area = s.cross.norm();
  s.area = 0.5 * twice_area;
  for (int k = 0; k < 3; ++k) {
    s.cotangent[k] = -s.edge[(k + 1) % 3].dot(s.edge[(k + 2) % 3]) / twice_area;
  }
  return s;
}

}  // namespace

SparseMatrix cotan_laplacian(const Points& vertices, const Faces& faces) {
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(12 * static_cast<size_t>(faces.rows()));
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    const FaceShape s = face_shape(vertices, faces, f);
    for (int k = 0; k < 3; ++k) {
      const int i = faces(f, (k + 1) % 3), j = faces(f, (k + 2) % 3);
      const double w = 0.5 * s.cotangent[k];
      entries.emplace_back(i, j, -w);
      entries.emplace_back(j, i, -w);
      entries.emplace_back(i, i, w);
      entries.emplace_back(j, j, w);
    }
  }
  SparseMatrix laplacian(vertices.rows(), vertices.rows());
  laplacian.setFromTriplets(entries.begin(), entries.end());
  return laplacian;
}

Eigen::VectorXd lumped_mass(const Points& vertices, const Faces& faces) {
  Eigen::VectorXd mass = Eigen::VectorXd::Zero(vertices.rows());
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    const FaceShape s = face_shape(vertices, faces, f);
    const auto obtuse = std::min_element(s.cotangent.begin(), s.cotangent.end());
    for (int k = 0; k < 3; ++k) {
      double area = 0.0;
      if (*obtuse >= 0.0) {  // the Voronoi region lies inside the face
        const int a = (k + 1) % 3, b = (k + 2) % 3;
        area =
            (s.edge[a].squaredNorm() * s.cotangent[a] + s.edge[b].squaredNorm() * s.cotangent[b]) /
            8.0;
      } else {
        area = (obtuse - s.cotangent.begin() == k) ? s.area / 2.0 : s.area / 4.0;
      }
      mass[faces(f, k)] += area;
    }
  }
  return mass;
}

SparseMatrix gradient(const Points& vertices, const Faces& faces) {
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(9 * static_cast<size_t>(faces.rows()));
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    const FaceShape s = face_shape(vertices, faces, f);
    for (int k = 0; k < 3; ++k) {
      // Gradient of corner k's hat function: the opposite edge turned into the face, over 2A.
      const Eigen::RowVector3d g = s.cross.cross(s.edge[k]) / s.cross.squaredNorm();
      for (int d = 0; d < 3; ++d) {
        entries.emplace_back(static_cast<int>(3 * f + d), faces(f, k), g[d]);
      }
    }
  }
  SparseMatrix result(3 * faces.rows(), vertices.rows());
  result.setFromTriplets(entries.begin(), entries.end());
  return result;
}

SparseMatrix divergence(const SparseMatrix& gradient, const Eigen::VectorXd& face_areas) {
  Eigen::VectorXd weights(gradient.rows());
  for (Eigen::Index f = 0; f < face_areas.size(); ++f) {
    weights.segment<3>(3 * f).setConstant(face_areas[f]);
  }
  return gradient.transpose() * weights.asDiagonal();
}

SparseRowMatrix average_faces_to_vertices(const Faces& faces, Eigen::Index vertex_count,
                                          AveragingWeights weights,
                                          const Eigen::VectorXd& face_areas) {
  Eigen::VectorXd total = Eigen::VectorXd::Zero(vertex_count);
  const auto weight = [&](Eigen::Index f) {
    return weights == AveragingWeights::uniform ? 1.0 : face_areas[f];
  };
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    for (int c = 0; c < 3; ++c) {
      total[faces(f, c)] += weight(f);
    }
  }
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(3 * static_cast<size_t>(faces.rows()));
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    for (int c = 0; c < 3; ++c) {
      entries.emplace_back(faces(f, c), static_cast<int>(f), weight(f) / total[faces(f, c)]);
    }
  }
  SparseRowMatrix average(vertex_count, faces.rows());
  average.setFromTriplets(entries.begin(), entries.end());
  return average;
}

Points vertex_normals(const Points& vertices, const Faces& faces) {
  Points normals = Points::Zero(vertices.rows(), 3);
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    const Eigen::RowVector3d cross = face_shape(vertices, faces, f).cross;
    for (int c = 0; c < 3; ++c) {
      normals.row(faces(f, c)) += cross;
    }
  }
  for (Eigen::Index i = 0; i < normals.rows(); ++i) {
    const double length = normals.row(i).norm();
    if (length > 0.0) {
      normals.row(i) /= length;
    }
  }
  return normals;
}

}  // namespace supple
