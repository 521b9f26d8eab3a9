// SPDX-License-Identifier: GPL-3.0-or-later
// The mesh zoo: small meshes generated in code, each chosen for one property that breaks something.
#pragma once

#include <string>
#include <vector>

#include "supple/core/types.h"

namespace supple::zoo {

struct Mesh {
  Points vertices;
  Faces faces;
};

// --- closed
// ---------------------------------------------------------------------------------------
/// Regular, 4 vertices: fewer than any number of eigenfunctions.
Mesh tetrahedron();
/// [0, 1]^3, two triangles a side: obtuse-free, right angles, cotangents of 0.
Mesh cube();
/// Unit sphere, 10 * 4^levels + 2 vertices; multiple eigenvalues.
Mesh icosphere(int levels);
/// Radii 1 and 0.4; genus 1.
Mesh torus(int around, int tube);
/// Box of 1 x 1 x `height` cells * `cells`, closed, exactly 4-fold symmetric about z.
Mesh square_tower(int cells, int height);
/// A sphere whose vertices and connectivity have no symmetry left: moved at random, edges flipped.
Mesh perturbed_sphere(int levels, unsigned seed);

// --- with a boundary
// ------------------------------------------------------------------------------
/// Triangulated [0, width] x [0, height] in the plane z = 0, unit cells of `cells` to a unit.
Mesh grid(int columns, int rows, double cell);
Mesh open_cylinder(int around, int along);
/// Flat disc of `rings` rings.
Mesh disc(int rings, int around);
/// One-sided; its face normals cannot agree.
Mesh moebius(int around, int across);

// --- topology that is no surface
// ------------------------------------------------------------------
/// Three sheets on one line of edges.
Mesh three_sheets(int cells);
/// Two cones that share only their tip.
Mesh pinched_vertex();

// --- several pieces
// -------------------------------------------------------------------------------
Mesh joined(const Mesh& a, const Mesh& b);
Mesh moved(Mesh mesh, const Eigen::RowVector3d& offset, double scale = 1.0);
/// Two identical spheres: every eigenvalue twice.
Mesh two_spheres(int levels);
/// A sphere inside a sphere.
Mesh nested_spheres(int levels);
/// `count` tetrahedra in a row: more pieces than small numbers of eigenfunctions.
Mesh many_pieces(int count);

// --- broken input
// ---------------------------------------------------------------------------------
/// Vertices of no face at the first, a middle and the last index.
Mesh with_unused_vertices(const Mesh& mesh);
/// One face (a, a, b), one whose corners are on a line, and one whose corners coincide.
Mesh with_zero_area_faces(const Mesh& mesh);
/// Every 7th face is split by a point at `thinness` (height over base) from an edge.
Mesh with_slivers(const Mesh& mesh, double thinness);

struct Entry {
  std::string name;
  Mesh mesh;
  int components = 1;
  int degenerate_faces = 0;
  int unattached_vertices = 0;
  int boundary_edges = 0;
  int nonmanifold_edges = 0;
};
/// Every property once, none larger than a few hundred vertices.
const std::vector<Entry>& all();

}  // namespace supple::zoo
