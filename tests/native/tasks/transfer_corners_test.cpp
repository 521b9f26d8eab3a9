// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <vector>

#include "native/support.h"
#include "supple/geometry/rotations.h"
#include "supple/tasks/transfer.h"

namespace supple {
namespace {

using test::fails_with;
using Uv = Eigen::RowVector2d;

SurfaceMap closest(const zoo::Mesh& to, const Points& points) {
  return ClosestSurfacePoints(to.vertices, to.faces).query(points).map;
}

double turns(double y, double x) { return std::atan2(y, x) / (2.0 * std::numbers::pi); }
// The angle in turns that is nearest to another.
double near(double angle, double to) { return angle + std::round(to - angle); }

using Unwrap = std::function<Uv(const Eigen::RowVector3d& point, const Uv* near_to)>;

Uv torus_uv(const Eigen::RowVector3d& p, const Uv* near_to) {
  Uv uv(turns(p[1], p[0]), turns(p[2], std::hypot(p[0], p[1]) - 1.0));
  if (near_to != nullptr) {
    uv << near(uv[0], (*near_to)[0]), near(uv[1], (*near_to)[1]);
  }
  return uv;
}

Uv cylinder_uv(const Eigen::RowVector3d& p, const Uv* near_to) {
  Uv uv(turns(p[1], p[0]), p[2]);
  if (near_to != nullptr) {
    uv[0] = near(uv[0], (*near_to)[0]);
  }
  return uv;
}

// By corner, each face around its centre: the seam is where the angle jumps.
RowMatrix<double> corner_uvs(const zoo::Mesh& mesh, const Unwrap& unwrap) {
  RowMatrix<double> uvs(3 * mesh.faces.rows(), 2);
  for (Eigen::Index f = 0; f < mesh.faces.rows(); ++f) {
    Eigen::RowVector3d centre = Eigen::RowVector3d::Zero();
    for (int c = 0; c < 3; ++c) {
      centre += mesh.vertices.row(mesh.faces(f, c)) / 3.0;
    }
    const Uv middle = unwrap(centre, nullptr);
    for (int c = 0; c < 3; ++c) {
      uvs.row(3 * f + c) = unwrap(mesh.vertices.row(mesh.faces(f, c)), &middle);
    }
  }
  return uvs;
}

void expect_unwrapped(const zoo::Mesh& source, const zoo::Mesh& target, const Unwrap& unwrap,
                      double tolerance) {
  const RowMatrix<double> uvs =
      transfer_corners(closest(source, target.vertices), {source.vertices, source.faces},
                       target.faces, corner_uvs(source, unwrap))
          .values;
  int over_the_seam = 0;
  for (Eigen::Index f = 0; f < target.faces.rows(); ++f) {
    const Uv first = uvs.row(3 * f);
    const Uv shift = first - unwrap(target.vertices.row(target.faces(f, 0)), nullptr);
    // One of the chart's periods, and the same for all corners of the face.
    for (int c = 0; c < 3; ++c) {
      const Uv uv = uvs.row(3 * f + c);
      const Uv truth = unwrap(target.vertices.row(target.faces(f, c)), &first);
      EXPECT_LT((uv - truth).norm(), tolerance) << f;
    }
    over_the_seam += std::abs(shift[0]) > 0.5 || uvs.middleRows(3 * f, 3).maxCoeff() > 0.5;
  }
  EXPECT_GT(over_the_seam, 0);  // or nothing was tested
}

TEST(TransferCorners, ATorusCutTwiceIsUnwrappedWithoutSpanning) {
  expect_unwrapped(zoo::torus(48, 24), zoo::torus(37, 31), torus_uv, 0.01);
}

TEST(TransferCorners, CoarseAndFineTargets) {
  expect_unwrapped(zoo::torus(48, 24), zoo::torus(13, 9), torus_uv, 0.03);
  expect_unwrapped(zoo::torus(18, 12), zoo::torus(65, 41), torus_uv, 0.03);
}

TEST(TransferCorners, ACylinderCutOpen) {
  expect_unwrapped(zoo::open_cylinder(40, 12), zoo::open_cylinder(27, 19), cylinder_uv, 0.01);
}

TEST(TransferCorners, TurnedCylindersCrossTheSeamInTheirFaces) {
  zoo::Mesh target = zoo::open_cylinder(28, 16);
  target.vertices = (target.vertices * rotation_matrix({0, 0, 0.037})).eval();
  expect_unwrapped(zoo::open_cylinder(40, 12), target, cylinder_uv, 0.01);
}

// Every triangle at a pole has its own place for it in the layout, half-way between its other two.
TEST(TransferCorners, TheFansAtAGlobesPolesKeepTheirOwnValues) {
  constexpr int kAround = 32, kRings = 19;
  zoo::Mesh globe;
  globe.vertices.resize(kAround * kRings + 2, 3);
  for (int r = 0; r < kRings; ++r) {
    for (int a = 0; a < kAround; ++a) {
      const double polar = std::numbers::pi * (r + 1) / (kRings + 1);
      const double angle = 2.0 * std::numbers::pi * a / kAround;
      globe.vertices.row(r * kAround + a) << std::sin(polar) * std::cos(angle),
          std::sin(polar) * std::sin(angle), std::cos(polar);
    }
  }
  const int north = kAround * kRings, south = north + 1;
  globe.vertices.bottomRows(2) << 0, 0, 1, 0, 0, -1;
  std::vector<Eigen::RowVector3i> faces;
  std::vector<Uv> uvs;
  const auto add = [&](std::array<int, 3> vertices, std::array<Uv, 3> at) {
    faces.emplace_back(vertices[0], vertices[1], vertices[2]);
    uvs.insert(uvs.end(), at.begin(), at.end());
  };
  for (int a = 0; a < kAround; ++a) {
    const int b = (a + 1) % kAround, last = (kRings - 1) * kAround;
    const double u = static_cast<double>(a) / kAround, next = u + 1.0 / kAround;
    const auto v = [](int ring) { return 1.0 - (ring + 1.0) / (kRings + 1.0); };
    add({north, a, b}, {Uv(u + 0.5 / kAround, 1), Uv(u, v(0)), Uv(next, v(0))});
    add({south, last + b, last + a},
        {Uv(u + 0.5 / kAround, 0), Uv(next, v(kRings - 1)), Uv(u, v(kRings - 1))});
    for (int r = 0; r + 1 < kRings; ++r) {
      const int top = r * kAround, low = top + kAround;
      add({top + a, low + a, low + b}, {Uv(u, v(r)), Uv(u, v(r + 1)), Uv(next, v(r + 1))});
      add({top + a, low + b, top + b}, {Uv(u, v(r)), Uv(next, v(r + 1)), Uv(next, v(r))});
    }
  }
  globe.faces.resize(static_cast<Eigen::Index>(faces.size()), 3);
  RowMatrix<double> corners(static_cast<Eigen::Index>(uvs.size()), 2);
  for (size_t f = 0; f < faces.size(); ++f) {
    globe.faces.row(static_cast<Eigen::Index>(f)) = faces[f];
  }
  for (size_t i = 0; i < uvs.size(); ++i) {
    corners.row(static_cast<Eigen::Index>(i)) = uvs[i];
  }
  const RowMatrix<double> got =
      transfer_corners(closest(globe, globe.vertices), {globe.vertices, globe.faces}, globe.faces,
                       corners)
          .values;
  EXPECT_LT((got - corners).cwiseAbs().maxCoeff(), 1e-6);
}

TEST(TransferCorners, APolygonsTrianglesAgreeAtTheirCorners) {
  const zoo::Mesh source = zoo::torus(48, 24), target = zoo::torus(37, 31);
  CornerOptions options;
  options.polygons.resize(target.faces.rows());
  for (Eigen::Index f = 0; f < target.faces.rows(); ++f) {
    options.polygons[f] = static_cast<int>(f / 2);  // two triangles after each other are a quad
  }
  const auto disagreements = [&](const CornerOptions& with) {
    const RowMatrix<double> uvs =
        transfer_corners(closest(source, target.vertices), {source.vertices, source.faces},
                         target.faces, corner_uvs(source, torus_uv), with)
            .values;
    int count = 0;
    for (Eigen::Index f = 0; f + 1 < target.faces.rows(); f += 2) {
      for (int i = 0; i < 9; ++i) {
        const int c = i / 3, d = i % 3;
        count += target.faces(f, c) == target.faces(f + 1, d) &&
                 (uvs.row(3 * f + c) - uvs.row(3 * f + 3 + d)).norm() > 1e-9;
      }
    }
    return count;
  };
  EXPECT_GT(disagreements({}), 0);
  EXPECT_EQ(disagreements(options), 0);
  options.polygons.conservativeResize(5);
  EXPECT_TRUE(fails_with(ErrorCode::wrong_shape, {"5 faces"}, [&] { disagreements(options); }));
}

// Six charts far apart in the atlas, one a side.
RowMatrix<double> side_uvs(const zoo::Mesh& cube) {
  RowMatrix<double> uvs(3 * cube.faces.rows(), 2);
  for (Eigen::Index f = 0; f < cube.faces.rows(); ++f) {
    for (int axis = 0; axis < 3; ++axis) {
      for (const double end : {0.0, 1.0}) {
        bool all = true;
        for (int c = 0; c < 3; ++c) {
          all = all && cube.vertices(cube.faces(f, c), axis) == end;
        }
        for (int c = 0; all && c < 3; ++c) {
          const auto p = cube.vertices.row(cube.faces(f, c));
          uvs.row(3 * f + c) << 10.0 * (2 * axis + end) + p[(axis + 1) % 3], p[(axis + 2) % 3];
        }
      }
    }
  }
  return uvs;
}

TEST(TransferCorners, NoFaceSpansTwoCharts) {
  const zoo::Mesh cube = zoo::cube();
  zoo::Mesh target = zoo::perturbed_sphere(3, 3);
  target.vertices = ((0.7 * target.vertices).rowwise() + Eigen::RowVector3d::Constant(0.5)).eval();
  const SurfaceMap map = closest(cube, target.vertices);
  const RowMatrix<double> uvs =
      transfer_corners(map, {cube.vertices, cube.faces}, target.faces, side_uvs(cube)).values;
  std::vector<bool> seen(6);
  for (Eigen::Index f = 0; f < target.faces.rows(); ++f) {
    const auto u = uvs.middleRows(3 * f, 3).col(0);
    const int chart = static_cast<int>(std::round((u.mean() - 0.5) / 10.0));
    seen[chart] = true;
    EXPECT_GT(u.minCoeff(), 10.0 * chart - 0.5);
    EXPECT_LT(u.maxCoeff(), 10.0 * chart + 1.5);
  }
  EXPECT_EQ(std::count(seen.begin(), seen.end(), true), 6);
}

TEST(TransferCorners, ColoursStayWithinTheirRangeAndKeepTheirEdges) {
  const zoo::Mesh cube = zoo::cube();
  RowMatrix<double> colours(3 * cube.faces.rows(), 4);
  for (Eigen::Index f = 0; f < cube.faces.rows(); ++f) {
    const bool red = cube.vertices(cube.faces(f, 0), 2) + cube.vertices(cube.faces(f, 1), 2) +
                         cube.vertices(cube.faces(f, 2), 2) ==
                     3.0;
    colours.middleRows(3 * f, 3).rowwise() =
        red ? Eigen::RowVector4d(1, 0, 0, 1) : Eigen::RowVector4d(0, 0, 1, 1);
  }
  zoo::Mesh target = zoo::icosphere(3);
  target.vertices = ((0.7 * target.vertices).rowwise() + Eigen::RowVector3d::Constant(0.5)).eval();
  CornerOptions options;
  options.extrapolate = false;
  const RowMatrix<double> result =
      transfer_corners(closest(cube, target.vertices), {cube.vertices, cube.faces}, target.faces,
                       colours, options)
          .values;
  int red = 0;
  for (Eigen::Index f = 0; f < target.faces.rows(); ++f) {
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(result(3 * f + c, 0), result(3 * f, 0), 1e-12);
      EXPECT_NEAR(result(3 * f + c, 0) + result(3 * f + c, 2), 1.0, 1e-12);
    }
    EXPECT_TRUE(std::abs(result(3 * f, 0)) < 1e-12 || std::abs(result(3 * f, 0) - 1.0) < 1e-12);
    red += result(3 * f, 0) > 0.5 ? 1 : 0;
  }
  EXPECT_GT(red, 0);
  EXPECT_LT(red, target.faces.rows() / 2);
}

TEST(TransferCorners, OfAMeshToItselfAreTheSame) {
  const zoo::Mesh mesh = zoo::torus(16, 12);
  const Eigen::Index n = mesh.vertices.rows();
  const SurfaceMap map =
      surface_map(Eigen::VectorXi::LinSpaced(n, 0, static_cast<int>(n) - 1), mesh.faces, n);
  const RowMatrix<double> uvs = corner_uvs(mesh, torus_uv);
  const RowMatrix<double> back =
      transfer_corners(map, {mesh.vertices, mesh.faces}, mesh.faces, uvs).values;
  EXPECT_LT((back - uvs).cwiseAbs().maxCoeff(), 1e-9);
}

class EveryTarget : public ::testing::TestWithParam<zoo::Entry> {};
SUPPLE_OVER_THE_ZOO(EveryTarget);

TEST_P(EveryTarget, ALinearFunctionComesBack) {
  const zoo::Mesh& mesh = GetParam().mesh;
  RowMatrix<double> corners(3 * mesh.faces.rows(), 3);
  for (Eigen::Index i = 0; i < corners.rows(); ++i) {
    corners.row(i) = mesh.vertices.row(mesh.faces(i / 3, i % 3));
  }
  SurfaceMap map = closest(mesh, mesh.vertices);
  const TransferredField result =
      transfer_corners(map, {mesh.vertices, mesh.faces}, mesh.faces, corners);
  const Points at = apply(map, mesh.faces, mesh.vertices);
  for (Eigen::Index i = 0; i < corners.rows(); ++i) {
    EXPECT_LT((result.values.row(i) - at.row(mesh.faces(i / 3, i % 3))).norm(),
              1e-6 * test::diagonal(mesh.vertices));
  }
  map.face.setConstant(-1);
  const TransferredField none =
      transfer_corners(map, {mesh.vertices, mesh.faces}, mesh.faces, corners, {}, 4.0);
  EXPECT_EQ(none.unmapped, mesh.vertices.rows());
  EXPECT_TRUE((none.values.array() == 4.0).all());
}

TEST(TransferCorners, SaysWhatIsWrong) {
  const zoo::Mesh mesh = zoo::cube();
  const SurfaceMap map = closest(mesh, mesh.vertices);
  const auto with = [&](const RowMatrix<double>& corners, const Faces& target) {
    return [&, corners, target] {
      transfer_corners(map, {mesh.vertices, mesh.faces}, target, corners);
    };
  };
  RowMatrix<double> corners = RowMatrix<double>::Zero(36, 2);
  EXPECT_TRUE(fails_with(ErrorCode::wrong_shape, {"35 corners", "36"},
                         with(corners.topRows(35), mesh.faces)));
  EXPECT_TRUE(fails_with(ErrorCode::index_out_of_range, {"Face 1", "target", "8 vertices"},
                         with(corners, (Faces(2, 3) << 0, 1, 2, 0, 1, 8).finished())));
  corners(7, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(fails_with(ErrorCode::not_finite, {"Corner 1", "face 2"}, with(corners, mesh.faces)));
}

}  // namespace
}  // namespace supple
