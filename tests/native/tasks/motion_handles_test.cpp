// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/tasks/motion_handles.h"

#include <limits>
#include <numeric>
#include <set>

#include "native/tasks/editing.h"
#include "supple/geometry/mesh.h"

namespace supple {
namespace {

// Few eigenfunctions: nothing here uses them.
std::shared_ptr<const PreparedMesh> rest_of(const zoo::Mesh& mesh) {
  return test::prepared(mesh, 8, 50);
}

// A sphere whose cap, where x is above 0.5, moves out.
struct Pair {
  zoo::Mesh mesh = zoo::perturbed_sphere(3, 4);
  Points moved = mesh.vertices;
  Pair() {
    for (Eigen::Index v = 0; v < moved.rows(); ++v) {
      if (moved(v, 0) > 0.5) {
        moved.row(v) += Eigen::RowVector3d(0.3, 0.8 + 0.1 * moved(v, 1), 0.0);
      }
    }
  }
};

void expect_equal(const std::vector<Eigen::VectorXi>& a, const std::vector<Eigen::VectorXi>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (size_t h = 0; h < a.size(); ++h) {
    ASSERT_EQ(a[h].size(), b[h].size()) << "handle " << h;
    EXPECT_EQ(a[h], b[h]) << "handle " << h;
  }
}

class MotionHandlesZoo : public ::testing::TestWithParam<zoo::Entry> {};

TEST_P(MotionHandlesZoo, NoTwoShareAVertexOrAnEdge) {
  const zoo::Mesh& mesh = GetParam().mesh;
  const auto prepared = rest_of(mesh);
  const Points moved = test::bent(mesh.vertices);
  const auto handles =
      propose_motion_handles(*prepared, moved, 12, 0.08 * test::diagonal(mesh.vertices));
  ASSERT_FALSE(handles.empty());
  EXPECT_LE(handles.size(), 12U);
  Eigen::VectorXi owner = Eigen::VectorXi::Constant(mesh.vertices.rows(), -1);
  for (size_t h = 0; h < handles.size(); ++h) {
    for (const int v : handles[h]) {
      EXPECT_EQ(owner[v], -1) << "vertex " << v;
      owner[v] = static_cast<int>(h);
    }
  }
  for (const int f : prepared->mesh.mesh_face()) {
    for (int c = 0; c < 3; ++c) {
      const int a = owner[mesh.faces(f, c)], b = owner[mesh.faces(f, (c + 1) % 3)];
      EXPECT_TRUE(a < 0 || b < 0 || a == b) << "face " << f;
    }
  }
}

SUPPLE_OVER_THE_ZOO(MotionHandlesZoo);

TEST(MotionHandles, TheFirstIsWhereItMovesFarthest) {
  const Pair pair;
  const auto handles = propose_motion_handles(*rest_of(pair.mesh), pair.moved, 16);
  ASSERT_EQ(handles.size(), 16U);
  for (const int v : handles.front()) {
    EXPECT_GT(pair.mesh.vertices(v, 0), 0.5 - 0.15) << "vertex " << v;
  }
  const auto on_cap = std::count_if(handles.begin(), handles.end(), [&](const auto& handle) {
    return pair.mesh.vertices(handle[0], 0) > 0.5;
  });
  EXPECT_GE(on_cap, 2);
}

TEST(MotionHandles, AnOnlyMovedPieceHasTheFirst) {
  const zoo::Mesh ball = zoo::perturbed_sphere(2, 4);
  const zoo::Mesh mesh = zoo::joined(ball, zoo::moved(ball, {5, 0, 0}, 0.4));
  const Eigen::Index half = ball.vertices.rows();
  Points moved = mesh.vertices;
  moved.bottomRows(half).rowwise() += Eigen::RowVector3d(0.0, 1.0, 0.3);
  const auto handles = propose_motion_handles(*rest_of(mesh), moved, 6);
  EXPECT_GE(handles[0].minCoeff(), half);
  EXPECT_LT(handles[1].maxCoeff(), half);  // the other piece, before the first gets a second
}

TEST(MotionHandles, EveryPieceGetsOneBeforeAnyGetsTwo) {
  const zoo::Mesh mesh = zoo::many_pieces(9);
  const auto prepared = rest_of(mesh);
  const auto handles = propose_motion_handles(*prepared, test::bent(mesh.vertices), 9, 0.0);
  std::set<int> pieces;
  for (const Eigen::VectorXi& handle : handles) {
    ASSERT_EQ(handle.size(), 1);
    pieces.insert(prepared->operators.component[prepared->mesh.surface_vertex()[handle[0]]]);
  }
  EXPECT_EQ(pieces.size(), 9U);
}

TEST(MotionHandles, SixteenCoverAFewPercentOfTheArea) {
  const zoo::Mesh mesh = zoo::icosphere(4);
  const auto prepared = rest_of(mesh);
  double share = 0.0;
  for (const auto& handle : propose_motion_handles(*prepared, test::bent(mesh.vertices))) {
    for (const int v : handle) {
      share += prepared->operators.mass[prepared->mesh.surface_vertex()[v]];
    }
  }
  EXPECT_GT(share, 0.02);
  EXPECT_LT(share, 0.06);
}

TEST(MotionHandles, TheWholeMayBeTurnedAndMoved) {
  const Pair pair;
  const auto prepared = rest_of(pair.mesh);
  const auto expected = propose_motion_handles(*prepared, pair.moved, 10, 0.2);
  for (uint64_t which = 0; which < 3; ++which) {
    const Points turned =
        (pair.moved * test::rotation(which)).rowwise() + Eigen::RowVector3d(3.0, -2.0, 7.0);
    expect_equal(propose_motion_handles(*prepared, turned, 10, 0.2), expected);
  }
}

TEST(MotionHandles, TheOrderOfVerticesIsOfNoMatter) {
  const Pair pair;
  const int n = static_cast<int>(pair.mesh.vertices.rows());
  zoo::Mesh other = pair.mesh;
  Points moved = pair.moved;
  const auto place = [n](int v) { return n - 1 - v; };
  for (int v = 0; v < n; ++v) {
    other.vertices.row(place(v)) = pair.mesh.vertices.row(v);
    moved.row(place(v)) = pair.moved.row(v);
  }
  other.faces = pair.mesh.faces.unaryExpr(place);
  auto expected = propose_motion_handles(*rest_of(pair.mesh), pair.moved, 10, 0.2);
  for (Eigen::VectorXi& handle : expected) {
    handle = handle.unaryExpr(place).reverse().eval();
  }
  expect_equal(propose_motion_handles(*rest_of(other), moved, 10, 0.2), expected);
}

TEST(MotionHandles, ErrorsSayWhatIsWrong) {
  const Pair pair;
  const auto prepared = rest_of(pair.mesh);
  const auto propose = [&](const Points& moved, int count, std::optional<double> radius) {
    return [=] { propose_motion_handles(*prepared, moved, count, radius); };
  };
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"10 vertices", "same vertices"},
                               propose(pair.moved.topRows(10), 4, {})));
  EXPECT_TRUE(
      test::fails_with(ErrorCode::bad_option, {"At least 1", "0"}, propose(pair.moved, 0, {})));
  EXPECT_TRUE(
      test::fails_with(ErrorCode::bad_option, {"radius", "-1"}, propose(pair.moved, 4, -1.0)));
  Points broken = pair.moved;
  broken(7, 2) = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(test::fails_with(ErrorCode::not_finite, {"vertex 7"}, propose(broken, 4, {})));
  const Points rigid =
      (pair.mesh.vertices * test::rotation(1)).rowwise() + Eigen::RowVector3d(1.0, 2.0, 3.0);
  EXPECT_TRUE(test::fails_with(ErrorCode::no_handles, {"nothing moves"}, propose(rigid, 4, {})));
}

}  // namespace
}  // namespace supple
