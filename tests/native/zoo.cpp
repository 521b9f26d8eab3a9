// SPDX-License-Identifier: GPL-3.0-or-later
#include "native/zoo.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <random>
#include <utility>

namespace supple::zoo {
namespace {

using std::numbers::pi;

class Builder {
 public:
  int vertex(double x, double y, double z) {
    points_.push_back({x, y, z});
    return static_cast<int>(points_.size()) - 1;
  }
  int vertex(const Eigen::RowVector3d& p) { return vertex(p[0], p[1], p[2]); }
  void face(int a, int b, int c) { faces_.push_back({a, b, c}); }
  /// (a, b, c, d) counter-clockwise, split along a-c.
  void quad(int a, int b, int c, int d) {
    face(a, b, c);
    face(a, c, d);
  }
  Mesh mesh() const {
    Mesh result;
    result.vertices.resize(static_cast<Eigen::Index>(points_.size()), 3);
    for (size_t i = 0; i < points_.size(); ++i) {
      result.vertices.row(static_cast<Eigen::Index>(i)) << points_[i][0], points_[i][1],
          points_[i][2];
    }
    result.faces.resize(static_cast<Eigen::Index>(faces_.size()), 3);
    for (size_t i = 0; i < faces_.size(); ++i) {
      result.faces.row(static_cast<Eigen::Index>(i)) << faces_[i][0], faces_[i][1], faces_[i][2];
    }
    return result;
  }

 private:
  std::vector<std::array<double, 3>> points_;
  std::vector<std::array<int, 3>> faces_;
};

void append_vertex(Mesh& mesh, const Eigen::RowVector3d& point) {
  mesh.vertices.conservativeResize(mesh.vertices.rows() + 1, 3);
  mesh.vertices.bottomRows<1>() = point;
}

void append_face(Mesh& mesh, int a, int b, int c) {
  mesh.faces.conservativeResize(mesh.faces.rows() + 1, 3);
  mesh.faces.bottomRows<1>() << a, b, c;
}

}  // namespace

Mesh tetrahedron() {
  Builder b;
  b.vertex(1, 1, 1);
  b.vertex(1, -1, -1);
  b.vertex(-1, 1, -1);
  b.vertex(-1, -1, 1);
  b.face(0, 1, 2);
  b.face(0, 3, 1);
  b.face(0, 2, 3);
  b.face(1, 3, 2);
  return b.mesh();
}

Mesh cube() {
  Builder b;
  for (int i = 0; i < 8; ++i) {
    b.vertex(i & 1, (i >> 1) & 1, (i >> 2) & 1);
  }
  b.quad(0, 2, 3, 1);
  b.quad(4, 5, 7, 6);
  b.quad(0, 1, 5, 4);
  b.quad(2, 6, 7, 3);
  b.quad(0, 4, 6, 2);
  b.quad(1, 3, 7, 5);
  return b.mesh();
}

Mesh icosphere(int levels) {
  const double t = std::numbers::phi;
  Builder b;
  const double corners[12][3] = {{-1, t, 0}, {1, t, 0}, {-1, -t, 0}, {1, -t, 0},
                                 {0, -1, t}, {0, 1, t}, {0, -1, -t}, {0, 1, -t},
                                 {t, 0, -1}, {t, 0, 1}, {-t, 0, -1}, {-t, 0, 1}};
  for (const auto& c : corners) {
    b.vertex(Eigen::RowVector3d(c[0], c[1], c[2]).normalized());
  }
  const int triangles[20][3] = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                                {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                                {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                                {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
  for (const auto& f : triangles) {
    b.face(f[0], f[1], f[2]);
  }
  Mesh mesh = b.mesh();
  for (int level = 0; level < levels; ++level) {
    Builder next;
    for (Eigen::Index i = 0; i < mesh.vertices.rows(); ++i) {
      next.vertex(Eigen::RowVector3d(mesh.vertices.row(i)));
    }
    std::map<std::pair<int, int>, int> middle;
    const auto split = [&](int i, int j) {
      const std::pair<int, int> edge = std::minmax(i, j);
      const auto [at, is_new] = middle.try_emplace(edge, 0);
      if (is_new) {
        at->second = next.vertex(
            Eigen::RowVector3d(mesh.vertices.row(edge.first) + mesh.vertices.row(edge.second))
                .normalized());
      }
      return at->second;
    };
    for (Eigen::Index f = 0; f < mesh.faces.rows(); ++f) {
      const int i = mesh.faces(f, 0), j = mesh.faces(f, 1), k = mesh.faces(f, 2);
      const int ij = split(i, j), jk = split(j, k), ki = split(k, i);
      next.face(i, ij, ki);
      next.face(ij, j, jk);
      next.face(ki, jk, k);
      next.face(ij, jk, ki);
    }
    mesh = next.mesh();
  }
  return mesh;
}

Mesh torus(int around, int tube) {
  Builder b;
  for (int i = 0; i < around; ++i) {
    for (int j = 0; j < tube; ++j) {
      const double u = 2 * pi * i / around, v = 2 * pi * j / tube;
      const double r = 1.0 + 0.4 * std::cos(v);
      b.vertex(r * std::cos(u), r * std::sin(u), 0.4 * std::sin(v));
    }
  }
  const auto at = [&](int i, int j) { return (i % around) * tube + j % tube; };
  for (int i = 0; i < around; ++i) {
    for (int j = 0; j < tube; ++j) {
      b.quad(at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
    }
  }
  return b.mesh();
}

Mesh square_tower(int cells, int height) {
  Builder b;
  std::map<std::array<int, 3>, int> known;
  // Doubled integer coordinates, so that the middle of a cell is an integer point too and the four
  // quarter turns take vertices to vertices and faces to faces.
  const auto at = [&](std::array<int, 3> p) {
    const auto [entry, is_new] = known.try_emplace(p, 0);
    if (is_new) {
      entry->second =
          b.vertex(0.5 * (p[0] - cells) / cells, 0.5 * (p[1] - cells) / cells, 0.5 * p[2] / cells);
    }
    return entry->second;
  };
  using Corner = std::array<int, 3>;
  const auto cell = [&](const Corner& a, const Corner& c1, const Corner& c2, const Corner& d) {
    const int middle = at({(a[0] + c2[0]) / 2, (a[1] + c2[1]) / 2, (a[2] + c2[2]) / 2});
    const int ids[4] = {at(a), at(c1), at(c2), at(d)};
    for (int k = 0; k < 4; ++k) {
      b.face(ids[k], ids[(k + 1) % 4], middle);
    }
  };
  const int w = 2 * cells, top = 2 * height;
  for (int i = 0; i < w; i += 2) {
    for (int j = 0; j < w; j += 2) {
      cell({i, j, 0}, {i, j + 2, 0}, {i + 2, j + 2, 0}, {i + 2, j, 0});
      cell({i, j, top}, {i + 2, j, top}, {i + 2, j + 2, top}, {i, j + 2, top});
    }
    for (int k = 0; k < top; k += 2) {
      cell({i, 0, k}, {i + 2, 0, k}, {i + 2, 0, k + 2}, {i, 0, k + 2});
      cell({i, w, k}, {i, w, k + 2}, {i + 2, w, k + 2}, {i + 2, w, k});
      cell({0, i, k}, {0, i, k + 2}, {0, i + 2, k + 2}, {0, i + 2, k});
      cell({w, i, k}, {w, i + 2, k}, {w, i + 2, k + 2}, {w, i, k + 2});
    }
  }
  return b.mesh();
}

Mesh perturbed_sphere(int levels, unsigned seed) {
  Mesh mesh = icosphere(levels);
  std::mt19937 generator(seed);
  const auto unit = [&] { return static_cast<double>(generator()) * 0x1.0p-32; };
  const double spacing = 1.0 / (1 << levels);
  for (Eigen::Index i = 0; i < mesh.vertices.rows(); ++i) {
    Eigen::RowVector3d p = mesh.vertices.row(i);
    p += 0.3 * spacing * Eigen::RowVector3d(unit() - 0.5, unit() - 0.5, unit() - 0.5);
    p = p.normalized() * (1.0 + 0.15 * std::sin(3.0 * p[0] + 1.0) * std::cos(2.0 * p[1] - p[2]));
    p[0] *= 1.3;
    p[2] *= 0.8;
    mesh.vertices.row(i) = p;
  }
  return mesh;
}

Mesh grid(int columns, int rows, double cell) {
  Builder b;
  for (int i = 0; i <= rows; ++i) {
    for (int j = 0; j <= columns; ++j) {
      b.vertex(cell * j, cell * i, 0);
    }
  }
  const auto at = [&](int i, int j) { return i * (columns + 1) + j; };
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < columns; ++j) {
      b.quad(at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j));
    }
  }
  return b.mesh();
}

Mesh open_cylinder(int around, int along) {
  Builder b;
  for (int i = 0; i <= along; ++i) {
    for (int j = 0; j < around; ++j) {
      const double u = 2 * pi * j / around;
      b.vertex(std::cos(u), std::sin(u), 3.0 * i / along);
    }
  }
  const auto at = [&](int i, int j) { return i * around + j % around; };
  for (int i = 0; i < along; ++i) {
    for (int j = 0; j < around; ++j) {
      b.quad(at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j));
    }
  }
  return b.mesh();
}

Mesh disc(int rings, int around) {
  Builder b;
  b.vertex(0, 0, 0);
  for (int r = 1; r <= rings; ++r) {
    for (int j = 0; j < around; ++j) {
      const double u = 2 * pi * (j + 0.5 * r) / around;
      b.vertex(std::cos(u) * r / rings, std::sin(u) * r / rings, 0);
    }
  }
  const auto at = [&](int r, int j) { return 1 + (r - 1) * around + (j + around) % around; };
  for (int j = 0; j < around; ++j) {
    b.face(0, at(1, j), at(1, j + 1));
    for (int r = 1; r < rings; ++r) {
      b.face(at(r, j), at(r + 1, j), at(r, j + 1));
      b.face(at(r, j + 1), at(r + 1, j), at(r + 1, j + 1));
    }
  }
  return b.mesh();
}

Mesh moebius(int around, int across) {
  Builder b;
  for (int i = 0; i < around; ++i) {
    for (int j = 0; j <= across; ++j) {
      const double u = 2 * pi * i / around, v = 0.8 * j / across - 0.4;
      const double r = 1.0 + v * std::cos(u / 2);
      b.vertex(r * std::cos(u), r * std::sin(u), v * std::sin(u / 2));
    }
  }
  // The last column meets the first one upside down.
  const auto at = [&](int i, int j) { return i < around ? i * (across + 1) + j : across - j; };
  for (int i = 0; i < around; ++i) {
    for (int j = 0; j < across; ++j) {
      b.quad(at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
    }
  }
  return b.mesh();
}

Mesh three_sheets(int cells) {
  Builder b;
  std::vector<int> spine;
  for (int i = 0; i <= cells; ++i) {
    spine.push_back(b.vertex(0, 0, double(i) / cells));
  }
  for (int sheet = 0; sheet < 3; ++sheet) {
    const double u = 2 * pi * sheet / 3;
    std::vector<int> previous = spine;
    for (int j = 1; j <= cells; ++j) {
      std::vector<int> next;
      for (int i = 0; i <= cells; ++i) {
        next.push_back(
            b.vertex(std::cos(u) * j / cells, std::sin(u) * j / cells, double(i) / cells));
      }
      for (int i = 0; i < cells; ++i) {
        b.quad(previous[i], next[i], next[i + 1], previous[i + 1]);
      }
      previous = next;
    }
  }
  return b.mesh();
}

Mesh pinched_vertex() {
  Builder b;
  const int tip = b.vertex(0, 0, 0);
  for (const double side : {1.0, -1.0}) {
    int ring[5];
    for (int j = 0; j < 5; ++j) {
      const double u = 2 * pi * j / 5;
      ring[j] = b.vertex(std::cos(u), side * std::sin(u), side);
    }
    const int lid = b.vertex(0, 0, 1.2 * side);
    for (int j = 0; j < 5; ++j) {
      b.face(tip, ring[(j + 1) % 5], ring[j]);
      b.face(lid, ring[j], ring[(j + 1) % 5]);
    }
  }
  return b.mesh();
}

Mesh joined(const Mesh& a, const Mesh& b) {
  Mesh result;
  result.vertices.resize(a.vertices.rows() + b.vertices.rows(), 3);
  result.vertices << a.vertices, b.vertices;
  result.faces.resize(a.faces.rows() + b.faces.rows(), 3);
  result.faces << a.faces, (b.faces.array() + static_cast<int>(a.vertices.rows())).matrix();
  return result;
}

Mesh moved(Mesh mesh, const Eigen::RowVector3d& offset, double scale) {
  mesh.vertices = (scale * mesh.vertices).rowwise() + offset;
  return mesh;
}

Mesh two_spheres(int levels) {
  return joined(icosphere(levels), moved(icosphere(levels), {3, 0, 0}));
}

Mesh nested_spheres(int levels) {
  return joined(icosphere(levels), moved(icosphere(levels), {0.1, 0, 0}, 0.5));
}

Mesh many_pieces(int count) {
  Mesh result = tetrahedron();
  for (int i = 1; i < count; ++i) {
    result = joined(result, moved(tetrahedron(), {4.0 * i, 0.3 * i, 0}, 1.0 + 0.1 * i));
  }
  return result;
}

Mesh with_unused_vertices(const Mesh& mesh) {
  const Eigen::Index half = mesh.vertices.rows() / 2;
  Mesh result;
  result.vertices.resize(mesh.vertices.rows() + 3, 3);
  result.vertices << Eigen::RowVector3d(2, 0.1, 0), mesh.vertices.topRows(half),
      Eigen::RowVector3d(0, 1.5, -1), mesh.vertices.bottomRows(mesh.vertices.rows() - half),
      Eigen::RowVector3d(-1, -1, 1);
  result.faces = mesh.faces;
  for (Eigen::Index i = 0; i < result.faces.size(); ++i) {
    int& index = result.faces.data()[i];
    index += index < half ? 1 : 2;
  }
  return result;
}

Mesh with_zero_area_faces(const Mesh& mesh) {
  Mesh result = mesh;
  append_face(result, 0, 0, 1);
  // Multiples of 0.1 are not on a line in floating point: the area is 1e-17, not 0.
  const auto n = static_cast<int>(mesh.vertices.rows());
  append_vertex(result, Eigen::RowVector3d(0.1, 0.2, 2.3));
  append_vertex(result, Eigen::RowVector3d(0.3, 0.6, 2.9));
  append_vertex(result, Eigen::RowVector3d(0.7, 1.4, 4.1));
  append_face(result, n, n + 1, n + 2);
  append_vertex(result, mesh.vertices.row(0));
  append_vertex(result, mesh.vertices.row(0));
  append_face(result, 0, n + 3, n + 4);
  return result;
}

Mesh with_slivers(const Mesh& mesh, double thinness) {
  Mesh result = mesh;
  for (Eigen::Index f = 0; f < mesh.faces.rows(); f += 7) {
    const int a = mesh.faces(f, 0), b = mesh.faces(f, 1), c = mesh.faces(f, 2);
    const Eigen::RowVector3d middle = 0.5 * (mesh.vertices.row(a) + mesh.vertices.row(b));
    const Eigen::RowVector3d base = mesh.vertices.row(b) - mesh.vertices.row(a);
    Eigen::RowVector3d inward = mesh.vertices.row(c) - middle;
    inward -= base * (inward.dot(base) / base.squaredNorm());
    const auto p = static_cast<int>(result.vertices.rows());
    append_vertex(result, middle + inward.normalized() * (thinness * base.norm()));
    result.faces.row(f) << a, b, p;
    append_face(result, b, c, p);
    append_face(result, c, a, p);
  }
  return result;
}

const std::vector<Entry>& all() {
  static const std::vector<Entry> entries = {
      {.name = "tetrahedron", .mesh = tetrahedron()},
      {.name = "cube", .mesh = cube()},
      {.name = "icosphere", .mesh = icosphere(2)},
      {.name = "torus", .mesh = torus(18, 10)},
      {.name = "square_tower", .mesh = square_tower(2, 6)},
      {.name = "perturbed_sphere", .mesh = perturbed_sphere(2, 7)},
      {.name = "open_cylinder", .mesh = open_cylinder(14, 8), .boundary_edges = 28},
      {.name = "disc", .mesh = disc(5, 12), .boundary_edges = 12},
      {.name = "moebius", .mesh = moebius(24, 3), .boundary_edges = 48},
      {.name = "three_sheets",
       .mesh = three_sheets(4),
       .boundary_edges = 3 * 12,
       .nonmanifold_edges = 4},
      {.name = "pinched_vertex", .mesh = pinched_vertex()},
      {.name = "two_spheres", .mesh = two_spheres(1), .components = 2},
      {.name = "nested_spheres", .mesh = nested_spheres(1), .components = 2},
      {.name = "many_pieces", .mesh = many_pieces(12), .components = 12},
      {.name = "unused_vertices",
       .mesh = with_unused_vertices(icosphere(1)),
       .unattached_vertices = 3},
      {.name = "zero_area_faces",
       .mesh = with_zero_area_faces(icosphere(1)),
       .degenerate_faces = 3,
       .unattached_vertices = 5},
      {.name = "slivers", .mesh = with_slivers(perturbed_sphere(2, 3), 1e-4)},
      {.name = "tiny", .mesh = moved(perturbed_sphere(1, 5), {0, 0, 0}, 1e-7)},
      {.name = "huge", .mesh = moved(perturbed_sphere(1, 5), {0, 0, 0}, 1e7)},
      {.name = "far_from_origin", .mesh = moved(perturbed_sphere(1, 5), {4000, -2000, 9000})},
  };
  return entries;
}

}  // namespace supple::zoo
