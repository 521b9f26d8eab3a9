// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Geometry>
#include <cmath>

#include "native/support.h"
#include "supple/geometry/jacobians.h"
#include "supple/geometry/mesh.h"
#include "supple/geometry/nearest.h"
#include "supple/geometry/operators.h"
#include "supple/geometry/rotations.h"
#include "supple/tasks/transfer.h"

namespace supple {
namespace {

using test::fails_with;
using Vector = Eigen::RowVector3d;

MeshView view(const zoo::Mesh& mesh) { return {mesh.vertices, mesh.faces}; }

// A lumpy body, long and flat: any triangulation of the sphere gives one of the same surface.
zoo::Mesh body(zoo::Mesh sphere) {
  for (Eigen::Index i = 0; i < sphere.vertices.rows(); ++i) {
    const Vector p = sphere.vertices.row(i).normalized();
    const double r = 1.0 + 0.12 * std::sin(3 * p[0] + 1) * std::sin(4 * p[1]) * std::cos(3 * p[2]);
    sphere.vertices.row(i) = r * p.cwiseProduct(Vector(0.5, 0.35, 1.2));
  }
  return sphere;
}

zoo::Mesh turned(zoo::Mesh mesh, uint64_t which) {
  mesh.vertices = (mesh.vertices * test::rotation(which)).eval();
  return mesh;
}

// Bends the upper part about x and twists all about z.
Points bent_body(Points points) {
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    const double z = points(i, 2);
    Vector p = points.row(i) * rotation_matrix({0, 0, 0.8 * z});
    const double over = std::max(0.0, z - 0.2), angle = 0.9 * over * over / (0.3 + over);
    p = (p - Vector(0, 0, 0.2)) * rotation_matrix({angle, 0, 0}) + Vector(0, 0, 0.2);
    points.row(i) = p;
  }
  return points;
}

// A lump on one side, smooth, and exactly nothing beyond its radius.
constexpr double kLump = 0.5;
const Vector kLumpCentre(0.0, 0.35, 0.3);
Points with_lump(Points points) {
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    const double t = (points.row(i) - kLumpCentre).norm() / kLump;
    if (t < 1.0) {
      points.row(i) += 0.15 * std::pow(1.0 - t * t, 3) * Vector(0.2, 1.0, 0.1).normalized();
    }
  }
  return points;
}

struct Pair {
  zoo::Mesh low = body(turned(zoo::icosphere(3), 4));
  zoo::Mesh high = body(zoo::icosphere(4));
  SurfaceMap map = ClosestSurfacePoints(low.vertices, low.faces).query(high.vertices).map;

  Points nearest_copy(const Points& key) const {
    const Eigen::VectorXi index = NearestPoints(low.vertices).query(high.vertices).index;
    Points result = high.vertices;
    for (Eigen::Index i = 0; i < result.rows(); ++i) {
      result.row(i) += key.row(index[i]) - low.vertices.row(index[i]);
    }
    return result;
  }
  Points blend_copy(const Points& key) const {
    return high.vertices + apply(map, low.faces, Points(key - low.vertices));
  }
  Points moved(const Points& key) const {
    return transfer_shape_keys(view(low), {key}, view(high), map).shapes[0];
  }
  double rms(const Points& a, const Points& b) const {
    const Eigen::VectorXd mass = lumped_mass(high.vertices, high.faces);
    return std::sqrt(mass.dot((a - b).rowwise().squaredNorm()) / mass.sum());
  }
  // Of the deformation's Jacobians: stairs are large in it however low they are.
  double roughness(const Points& a, const Points& truth) const {
    const MatrixField inverse = inverse_frames(face_frames(high.vertices, high.faces));
    const Eigen::VectorXd area = face_areas(high.vertices, high.faces);
    const Eigen::VectorXd squared =
        (jacobians(inverse, a, high.faces) - jacobians(inverse, truth, high.faces))
            .rowwise()
            .squaredNorm();
    return std::sqrt(area.dot(squared) / area.sum());
  }
};

TEST(TransferShapeKeys, AreNearerToTheTruthThanCopiedOffsets) {
  const Pair pair;
  for (const auto& deform : {bent_body, with_lump}) {
    const Points key = deform(pair.low.vertices), truth = deform(pair.high.vertices);
    const Points result = pair.moved(key);
    EXPECT_LT(pair.rms(result, truth), 0.3 * pair.rms(pair.nearest_copy(key), truth));
    EXPECT_LT(pair.rms(result, truth), pair.rms(pair.blend_copy(key), truth));
    EXPECT_LT(pair.roughness(result, truth), 0.4 * pair.roughness(pair.nearest_copy(key), truth));
    EXPECT_LT(pair.roughness(result, truth), pair.roughness(pair.blend_copy(key), truth));
  }
}

TEST(TransferShapeKeys, AMeshToItselfGivesTheKey) {
  const zoo::Mesh mesh = body(zoo::icosphere(3));
  const Eigen::Index n = mesh.vertices.rows();
  const SurfaceMap map =
      surface_map(Eigen::VectorXi::LinSpaced(n, 0, static_cast<int>(n) - 1), mesh.faces, n);
  const Points key = bent_body(mesh.vertices);
  const TransferredShapes result = transfer_shape_keys(view(mesh), {key}, view(mesh), map);
  EXPECT_TRUE(result.coincide);
  // What averaged Jacobians smooth, a fraction of an edge (0.1).
  EXPECT_LT(test::farthest(result.shapes[0], key), 0.01);
}

TEST(TransferShapeKeys, WhatIsAtRestStaysExactly) {
  const Pair pair;
  const std::vector<Points> keys{pair.low.vertices, with_lump(pair.low.vertices)};
  const auto shapes = transfer_shape_keys(view(pair.low), keys, view(pair.high), pair.map).shapes;
  EXPECT_EQ(shapes[0], pair.high.vertices);
  int still = 0;
  for (Eigen::Index i = 0; i < pair.high.vertices.rows(); ++i) {
    // Beyond the lump by two edges of the source.
    if ((pair.high.vertices.row(i) - kLumpCentre).norm() > kLump + 0.4) {
      EXPECT_EQ(shapes[1].row(i), pair.high.vertices.row(i));
      ++still;
    }
  }
  EXPECT_GT(still, pair.high.vertices.rows() / 3);
}

TEST(TransferShapeKeys, AffineMotionsAreExactInPlace) {
  const Pair pair;
  const Matrix3 linear = test::rotation(1) * Eigen::Vector3d(1.2, 0.9, 1.1).asDiagonal();
  const auto moved = [&](const Points& p) -> Points {
    return (p * linear).rowwise() + Vector(1, 2, 3);
  };
  // A Jacobian takes unit normals to unit normals, so a stretch is exact in the surface alone and
  // a rotation altogether.
  EXPECT_LT(test::farthest(pair.moved(moved(pair.low.vertices)), moved(pair.high.vertices)), 0.02);
  const auto turned = [&](const Points& p) -> Points {
    return (p * test::rotation(1)).rowwise() + Vector(1, 2, 3);
  };
  EXPECT_LT(test::farthest(pair.moved(turned(pair.low.vertices)), turned(pair.high.vertices)),
            1e-9);
}

TEST(TransferShapeKeys, ATargetElsewhereAndLargerGetsTheSame) {
  const Pair pair;
  const auto elsewhere = [](const Points& p) -> Points {
    return (100.0 * p * test::rotation(6)).rowwise() + Vector(500, 0, -40);
  };
  const Points placed = elsewhere(pair.high.vertices);
  const Points key = bent_body(pair.low.vertices), truth = bent_body(pair.high.vertices);
  const TransferredShapes result =
      transfer_shape_keys(view(pair.low), {key}, {placed, pair.high.faces}, pair.map);
  EXPECT_TRUE(result.coincide);
  const Points back = (((result.shapes[0].rowwise() - Vector(500, 0, -40)) / 100.0) *
                       test::rotation(6).transpose());
  EXPECT_LT(pair.rms(back, truth), 0.3 * pair.rms(pair.nearest_copy(key), truth));
}

TEST(TransferShapeKeys, AnotherShapeGetsTheLumpInItsOwnFrame) {
  const Pair pair;
  // Twice as thick, turned, and bent: no similarity makes it the source.
  Points other = bent_body(pair.high.vertices);
  other.col(1) *= 2.0;
  other = (other * test::rotation(3)).eval();
  const TransferredShapes result = transfer_shape_keys(
      view(pair.low), {with_lump(pair.low.vertices)}, {other, pair.high.faces}, pair.map);
  EXPECT_FALSE(result.coincide);
  const Points moves = result.shapes[0] - other;
  const Points normals = vertex_normals(other, pair.high.faces);
  const Points truth = with_lump(pair.high.vertices) - pair.high.vertices;
  const Points true_normals = vertex_normals(pair.high.vertices, pair.high.faces);
  Eigen::Index top = 0;
  truth.rowwise().norm().maxCoeff(&top);
  // As large for its size, and as far outwards, where the source's is.
  const double size = std::sqrt(face_areas(other, pair.high.faces).sum() /
                                face_areas(pair.high.vertices, pair.high.faces).sum());
  EXPECT_NEAR(moves.row(top).norm() / (size * truth.row(top).norm()), 1.0, 0.35);
  EXPECT_NEAR(moves.row(top).normalized().dot(normals.row(top)),
              truth.row(top).normalized().dot(true_normals.row(top)), 0.2);
  for (Eigen::Index i = 0; i < moves.rows(); ++i) {
    if ((pair.high.vertices.row(i) - kLumpCentre).norm() > kLump + 0.4) {
      EXPECT_TRUE(moves.row(i).isZero(0.0));
    }
  }
}

TEST(TransferShapeKeys, AVertexWithoutAPartnerMovesWithItsNeighbours) {
  const Pair pair;
  SurfaceMap holes = pair.map;
  for (Eigen::Index i = 0; i < holes.size(); i += 10) {
    holes.face[i] = -1;
    holes.weights.row(i).setZero();
  }
  const Points key = bent_body(pair.low.vertices), truth = bent_body(pair.high.vertices);
  const TransferredShapes result =
      transfer_shape_keys(view(pair.low), {key}, view(pair.high), holes);
  EXPECT_EQ(result.unmapped, (holes.size() + 9) / 10);
  EXPECT_LT(pair.rms(result.shapes[0], truth), 0.4 * pair.rms(pair.nearest_copy(key), truth));
}

class EveryShape : public ::testing::TestWithParam<zoo::Entry> {};
SUPPLE_OVER_THE_ZOO(EveryShape);

TEST_P(EveryShape, IsTurnedAsItsSourceIs) {
  const zoo::Mesh& mesh = GetParam().mesh;
  const SurfaceMap map = ClosestSurfacePoints(mesh.vertices, mesh.faces).query(mesh.vertices).map;
  const auto turned = [&](const Points& p) -> Points { return p * test::rotation(5); };
  const TransferredShapes result =
      transfer_shape_keys(view(mesh), {turned(mesh.vertices)}, view(mesh), map);
  EXPECT_TRUE(result.shapes[0].allFinite());
  EXPECT_LT(test::farthest(result.shapes[0], turned(mesh.vertices)),
            1e-6 * test::diagonal(mesh.vertices));
}

TEST(TransferShapeKeys, SaysWhatIsWrong) {
  const Pair pair;
  const auto with = [&](const Points& key, const SurfaceMap& map) {
    return [&, key, map] { transfer_shape_keys(view(pair.low), {key}, view(pair.high), map); };
  };
  Points key = pair.low.vertices;
  EXPECT_TRUE(fails_with(ErrorCode::wrong_shape, {"Shape key 0", "5 vertices", "642"},
                         with(key.topRows(5), pair.map)));
  SurfaceMap none = pair.map;
  none.face.setConstant(-1);
  EXPECT_TRUE(fails_with(ErrorCode::bad_option, {"no vertex"}, with(key, none)));
  none.face.setConstant(99999);
  EXPECT_TRUE(fails_with(ErrorCode::index_out_of_range, {"99999"}, with(key, none)));
  key(3, 1) = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(fails_with(ErrorCode::not_finite, {"Shape key 0"}, with(key, pair.map)));
  Progress progress;
  progress.cancel();
  EXPECT_TRUE(fails_with(ErrorCode::cancelled, {}, [&] {
    transfer_shape_keys(view(pair.low), {pair.low.vertices}, view(pair.high), pair.map,
                        ProgressRange(&progress));
  }));
}

}  // namespace
}  // namespace supple
