// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "supple/core/error.h"
#include "supple/geometry/nearest.h"

namespace supple {
namespace {

// A face this thin (height over longest edge) has cotangents beyond what a double-precision solve
// can carry to 1e-9; it is treated as having no area.
constexpr double kThinnest = 1e-8;

Eigen::RowVector3d corner_cross(const Points& v, const Faces& f, Eigen::Index i) {
  const Eigen::RowVector3d a = v.row(f(i, 1)) - v.row(f(i, 0));
  const Eigen::RowVector3d b = v.row(f(i, 2)) - v.row(f(i, 0));
  return a.cross(b);
}

int find_root(std::vector<int>& parent, int i) {
  while (parent[i] != i) {
    parent[i] = parent[parent[i]];
    i = parent[i];
  }
  return i;
}

void check_input(const Points& vertices, const Faces& faces) {
  if (faces.rows() == 0) {
    throw Error(ErrorCode::empty_mesh,
                "The mesh has no faces. Supple works on surfaces: give it at least one triangle.");
  }
  for (Eigen::Index i = 0; i < vertices.rows(); ++i) {
    if (!vertices.row(i).allFinite()) {
      throw Error(ErrorCode::not_finite, "Vertex " + std::to_string(i) +
                                             " has a coordinate that is not a finite number. "
                                             "Repair or delete it.");
    }
  }
  for (Eigen::Index i = 0; i < faces.rows(); ++i) {
    for (int c = 0; c < 3; ++c) {
      if (faces(i, c) < 0 || faces(i, c) >= vertices.rows()) {
        throw Error(ErrorCode::index_out_of_range,
                    "Face " + std::to_string(i) + " names vertex " + std::to_string(faces(i, c)) +
                        ", but the mesh has " + std::to_string(vertices.rows()) +
                        " vertices, counted from 0.");
      }
    }
  }
}

}  // namespace

TriangleMesh::TriangleMesh(Points vertices, Faces faces)
    : vertices_(std::move(vertices)), faces_(std::move(faces)) {
  check_input(vertices_, faces_);
  find_surface();
  find_components();
  note_edges();
}

void TriangleMesh::find_surface() {
  std::vector<int> kept;
  for (int i = 0; i < faces_.rows(); ++i) {
    if (!is_degenerate(vertices_, faces_, i)) {
      kept.push_back(i);
    }
  }
  if (kept.empty()) {
    throw Error(ErrorCode::empty_mesh, "None of the mesh's " + std::to_string(faces_.rows()) +
                                           " faces has an area. Check its scale and its vertices.");
  }
  if (const int dropped = static_cast<int>(faces_.rows()) - static_cast<int>(kept.size())) {
    notes_.push_back({"degenerate_faces", dropped,
                      std::to_string(dropped) +
                          " faces without area are ignored; their vertices move with the rest."});
  }

  mesh_face_ = Eigen::Map<Eigen::VectorXi>(kept.data(), static_cast<Eigen::Index>(kept.size()));
  surface_vertex_.setConstant(vertices_.rows(), -1);
  for (const int face : kept) {
    for (int c = 0; c < 3; ++c) {
      surface_vertex_[faces_(face, c)] = 0;
    }
  }
  std::vector<int> attached, unattached;
  for (int i = 0; i < vertices_.rows(); ++i) {
    if (surface_vertex_[i] == 0) {
      surface_vertex_[i] = static_cast<int>(attached.size());
      attached.push_back(i);
    } else {
      unattached.push_back(i);
    }
  }
  mesh_vertex_ =
      Eigen::Map<Eigen::VectorXi>(attached.data(), static_cast<Eigen::Index>(attached.size()));
  surface_faces_.resize(mesh_face_.size(), 3);
  for (Eigen::Index i = 0; i < mesh_face_.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      surface_faces_(i, c) = surface_vertex_[faces_(mesh_face_[i], c)];
    }
  }
  surface_vertices_.resize(mesh_vertex_.size(), 3);
  for (Eigen::Index i = 0; i < mesh_vertex_.size(); ++i) {
    surface_vertices_.row(i) = vertices_.row(mesh_vertex_[i]);
  }
  centre_ = surface_vertices_.colwise().mean();
  scale_ = std::sqrt(face_areas(surface_vertices_, surface_faces_).sum());
  surface_vertices_ = (surface_vertices_.rowwise() - centre_) / scale_;

  if (!unattached.empty()) {
    unattached_ = Eigen::Map<Eigen::VectorXi>(unattached.data(),
                                              static_cast<Eigen::Index>(unattached.size()));
    Points loose(unattached_.size(), 3);
    for (Eigen::Index i = 0; i < unattached_.size(); ++i) {
      loose.row(i) = vertices_.row(unattached_[i]);
    }
    anchor_ = NearestPoints(surface_vertices_).query(to_surface(loose)).index;
    notes_.push_back({"unattached_vertices", static_cast<int>(unattached.size()),
                      std::to_string(unattached.size()) +
                          " vertices belong to no face with an area; each moves with the nearest "
                          "vertex that does."});
  }
}

void TriangleMesh::find_components() {
  const auto n = surface_vertices_.rows();
  std::vector<int> parent(n);
  std::iota(parent.begin(), parent.end(), 0);
  for (Eigen::Index f = 0; f < surface_faces_.rows(); ++f) {
    const int a = find_root(parent, surface_faces_(f, 0));
    for (int c = 1; c < 3; ++c) {
      parent[find_root(parent, surface_faces_(f, c))] = a;
    }
  }
  component_.resize(n);
  std::vector<int> label(n, -1);
  component_count_ = 0;
  for (int i = 0; i < n; ++i) {
    int& l = label[find_root(parent, i)];
    if (l < 0) {
      l = component_count_++;
    }
    component_[i] = l;
  }
  if (component_count_ > 1) {
    notes_.push_back({"components", component_count_,
                      "The mesh has " + std::to_string(component_count_) +
                          " separate pieces; a piece without a handle follows the nearest one "
                          "that has one."});
  }
}

void TriangleMesh::note_edges() {
  std::vector<std::array<int, 2>> edges;
  edges.reserve(3 * static_cast<size_t>(surface_faces_.rows()));
  for (Eigen::Index f = 0; f < surface_faces_.rows(); ++f) {
    for (int c = 0; c < 3; ++c) {
      const int a = surface_faces_(f, c), b = surface_faces_(f, (c + 1) % 3);
      edges.push_back({std::min(a, b), std::max(a, b)});
    }
  }
  std::sort(edges.begin(), edges.end());
  int boundary = 0, nonmanifold = 0;
  for (size_t i = 0; i < edges.size();) {
    size_t j = i;
    while (j < edges.size() && edges[j] == edges[i]) {
      ++j;
    }
    boundary += (j - i == 1) ? 1 : 0;
    nonmanifold += (j - i > 2) ? 1 : 0;
    i = j;
  }
  if (boundary > 0) {
    notes_.push_back({"boundary", boundary,
                      std::to_string(boundary) +
                          " edges lie on a boundary; the surface is free to bend there."});
  }
  if (nonmanifold > 0) {
    notes_.push_back({"nonmanifold_edges", nonmanifold,
                      std::to_string(nonmanifold) +
                          " edges have more than two faces; each face counts with its own shape."});
  }
}

bool TriangleMesh::same_surface_vertices(const TriangleMesh& other) const {
  return mesh_vertex_.size() == other.mesh_vertex_.size() && mesh_vertex_ == other.mesh_vertex_;
}

double TriangleMesh::diagonal() const {
  return (vertices_.colwise().maxCoeff() - vertices_.colwise().minCoeff()).norm();
}

Points TriangleMesh::to_surface(const Points& points) const {
  return (points.rowwise() - centre_) / scale_;
}

Points TriangleMesh::from_surface(const Points& points) const {
  return (points * scale_).rowwise() + centre_;
}

Points TriangleMesh::scatter(const Points& before, const Points& moved,
                             const MatrixField& vertex_jacobians) const {
  Points result(vertices_.rows(), 3);
  for (Eigen::Index i = 0; i < mesh_vertex_.size(); ++i) {
    result.row(mesh_vertex_[i]) = moved.row(i) * scale_ + centre_;
  }
  for (Eigen::Index i = 0; i < unattached_.size(); ++i) {
    const int anchor = anchor_[i];
    const Eigen::RowVector3d away =
        (before.row(unattached_[i]) - before.row(mesh_vertex_[anchor])) / scale_;
    result.row(unattached_[i]) =
        (moved.row(anchor) + away * matrix_at(vertex_jacobians, anchor)) * scale_ + centre_;
  }
  return result;
}

bool is_degenerate(const Points& v, const Faces& f, Eigen::Index i) {
  if (f(i, 0) == f(i, 1) || f(i, 1) == f(i, 2) || f(i, 2) == f(i, 0)) {
    return true;
  }
  double longest = 0.0;
  for (int e = 0; e < 3; ++e) {
    longest = std::max(longest, (v.row(f(i, e)) - v.row(f(i, (e + 1) % 3))).squaredNorm());
  }
  return !(corner_cross(v, f, i).norm() > kThinnest * longest);
}

Eigen::VectorXd face_areas(const Points& vertices, const Faces& faces) {
  Eigen::VectorXd areas(faces.rows());
#pragma omp parallel for schedule(static)
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    areas[f] = 0.5 * corner_cross(vertices, faces, f).norm();
  }
  return areas;
}

Points face_normals(const Points& vertices, const Faces& faces) {
  Points normals(faces.rows(), 3);
#pragma omp parallel for schedule(static)
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    const Eigen::RowVector3d cross = corner_cross(vertices, faces, f);
    const double length = cross.norm();
    normals.row(f) = length > 0.0 ? Eigen::RowVector3d(cross / length) : Eigen::RowVector3d::Zero();
  }
  return normals;
}

}  // namespace supple
