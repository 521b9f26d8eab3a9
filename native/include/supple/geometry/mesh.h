// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "supple/core/types.h"

namespace supple {

/// Something unusual found in a mesh, and what was done about it.
struct Note {
  std::string code;     ///< "degenerate_faces", "unattached_vertices", "boundary", ...
  int count = 0;        ///< how many places
  std::string message;  ///< for people: what it is and what was done
};

/// A triangle mesh whose input was checked, split into the part that carries differential operators
/// and the vertices that only follow it.
///
/// Real meshes have faces without area and vertices without faces; neither has a Laplacian. They
/// are left out of the `surface_*` arrays, and `scatter` gives them positions again.
class TriangleMesh {
 public:
  /// vertices: n x 3, finite, in the caller's units. faces: m x 3, each index in [0, n).
  /// Errors: `empty_mesh` (no faces, or none with an area), `index_out_of_range`, `not_finite`; the
  /// message names the first bad row.
  TriangleMesh(Points vertices, Faces faces);

  const Points& vertices() const { return vertices_; }
  const Faces& faces() const { return faces_; }
  /// Degenerate faces, unattached vertices, boundary, non-manifold edges, components: one each.
  const std::vector<Note>& notes() const { return notes_; }

  /// ns x 3: the attached vertices, in units where the surface has area 1 and centroid 0.
  const Points& surface_vertices() const { return surface_vertices_; }
  /// ms x 3: the faces with an area, indexing `surface_vertices`.
  const Faces& surface_faces() const { return surface_faces_; }
  /// ns: the mesh vertex of each surface vertex.
  const Eigen::VectorXi& mesh_vertex() const { return mesh_vertex_; }
  /// n: the surface vertex of each mesh vertex, -1 where it has none.
  const Eigen::VectorXi& surface_vertex() const { return surface_vertex_; }
  /// ms: the mesh face of each surface face.
  const Eigen::VectorXi& mesh_face() const { return mesh_face_; }
  /// ns: the connected component of each surface vertex, 0-based.
  const Eigen::VectorXi& component() const { return component_; }
  int component_count() const { return component_count_; }

  /// Whether the same mesh vertices are attached in both meshes.
  bool same_surface_vertices(const TriangleMesh& other) const;

  /// Caller's units per unit of the surface: the square root of the area.
  double scale() const { return scale_; }
  /// Length of the bounding box's diagonal, in the caller's units.
  double diagonal() const;

  /// k x 3 points from the caller's units to the surface's, and back.
  Points to_surface(const Points& points) const;
  Points from_surface(const Points& points) const;

  /// ns x 3 moved surface vertices and ns x 9 vertex Jacobians (V' = V J, rows) to n x 3 vertices
  /// in the caller's units. An unattached vertex moves with the surface vertex that is nearest to
  /// it at rest. before: n x 3, caller's units, where the Jacobians are taken from; the rest
  /// vertices if not given.
  Points scatter(const Points& moved, const MatrixField& vertex_jacobians) const {
    return scatter(vertices_, moved, vertex_jacobians);
  }
  Points scatter(const Points& before, const Points& moved,
                 const MatrixField& vertex_jacobians) const;

 private:
  void find_surface();
  void find_components();
  void note_edges();

  Points vertices_;
  Faces faces_;
  std::vector<Note> notes_;
  Points surface_vertices_;
  Faces surface_faces_;
  Eigen::VectorXi mesh_vertex_, surface_vertex_, mesh_face_, component_;
  Eigen::VectorXi unattached_, anchor_;  // mesh vertex; the surface vertex it follows
  Eigen::RowVector3d centre_ = Eigen::RowVector3d::Zero();
  double scale_ = 1.0;
  int component_count_ = 0;
};

/// Whether face i has no area that a double-precision solve could use: a repeated corner, or a
/// height below 1e-8 of its longest edge.
bool is_degenerate(const Points& vertices, const Faces& faces, Eigen::Index i);

/// m: area of each face, in squared units of the vertices.
Eigen::VectorXd face_areas(const Points& vertices, const Faces& faces);

/// m x 3: unit normals by the right-hand rule; a zero row where a face has no area.
Points face_normals(const Points& vertices, const Faces& faces);

}  // namespace supple
