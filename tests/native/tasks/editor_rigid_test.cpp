// SPDX-License-Identifier: GPL-3.0-or-later
// Where every handle asks for one rigid motion, the mesh makes exactly that motion.
#include "native/tasks/editing.h"

namespace supple {
namespace {

enum class Pieces { all, first };

class RigidZoo : public ::testing::TestWithParam<zoo::Entry> {
 protected:
  // A few vertices of each piece, or of the first one only; the others have to follow.
  std::vector<Handle> handles(const TriangleMesh& mesh, Pieces pieces) const {
    std::vector<int> first, second;
    std::vector<int> seen(static_cast<size_t>(mesh.component_count()), 0);
    for (int i = 0; i < mesh.component().size(); ++i) {
      const int component = mesh.component()[i];
      const int count = seen[static_cast<size_t>(component)]++;
      if (pieces == Pieces::all || component == 0) {
        if (count < 2) {
          first.push_back(mesh.mesh_vertex()[i]);
        } else if (count < 4 || count % 9 == 0) {
          second.push_back(mesh.mesh_vertex()[i]);
        }
      }
    }
    const auto vertices = [](std::vector<int>& v) {
      return Eigen::VectorXi(Eigen::VectorXi::Map(v.data(), static_cast<Eigen::Index>(v.size())));
    };
    return {{"first", vertices(first)}, {"second", vertices(second)}};
  }

  void expect_rigid(Pieces pieces, bool with_network) const {
    const zoo::Mesh& mesh = GetParam().mesh;
    const auto prepared = test::prepared(mesh);
    const Editor editor(prepared, handles(prepared->mesh, pieces),
                        with_network ? test::editing_network() : nullptr);
    const double size = test::diagonal(mesh.vertices);
    for (const auto& [name, options] : test::kinds(5)) {
      const Matrix3 turn = test::rotation(3);
      const Eigen::RowVector3d offset = size * Eigen::RowVector3d(0.4, -0.9, 0.2);
      const HandleTarget target{.matrix = test::affine(turn, offset), .positions = {}};
      const Points got = editor.solve({target, target}, options).vertices;
      const Points expected = (mesh.vertices * turn).rowwise() + offset;
      EXPECT_LT(test::farthest(got, expected), 1e-9 * size) << name;
    }
  }
};

TEST_P(RigidZoo, WithoutANetwork) { expect_rigid(Pieces::all, false); }
TEST_P(RigidZoo, WithANetwork) { expect_rigid(Pieces::all, true); }
TEST_P(RigidZoo, LoosePiecesFollowWithoutANetwork) { expect_rigid(Pieces::first, false); }
TEST_P(RigidZoo, LoosePiecesFollowWithANetwork) { expect_rigid(Pieces::first, true); }

TEST_P(RigidZoo, HandlesHeldLeaveTheMeshAsItIs) {
  const zoo::Mesh& mesh = GetParam().mesh;
  const auto prepared = test::prepared(mesh);
  const Editor editor(prepared, handles(prepared->mesh, Pieces::all), test::editing_network());
  const Points got = editor.solve({{}, {}}).vertices;
  EXPECT_LT(test::farthest(got, mesh.vertices), 1e-9 * test::diagonal(mesh.vertices));
}

SUPPLE_OVER_THE_ZOO(RigidZoo);

class RigidHandles : public ::testing::Test {
 protected:
  void expect_rigid(const std::vector<Handle>& handles) const {
    const auto prepared = test::prepared(mesh);
    const Editor editor(prepared, handles, test::editing_network());
    const Matrix3 turn = test::rotation(6);
    const HandleTarget target{.matrix = test::affine(turn, {1, 2, 3}), .positions = {}};
    const Points got = editor.solve(std::vector<HandleTarget>(handles.size(), target)).vertices;
    const Points expected = (mesh.vertices * turn).rowwise() + Eigen::RowVector3d(1, 2, 3);
    EXPECT_LT(test::farthest(got, expected), 1e-9 * test::diagonal(mesh.vertices));
  }
  zoo::Mesh mesh = zoo::with_unused_vertices(zoo::perturbed_sphere(2, 4));
};

TEST_F(RigidHandles, OfOneVertexEach) {
  expect_rigid({{"a", Eigen::VectorXi::Constant(1, 5)}, {"b", Eigen::VectorXi::Constant(1, 60)}});
}

TEST_F(RigidHandles, OneOnly) { expect_rigid({{"a", Eigen::VectorXi::LinSpaced(5, 20, 24)}}); }

TEST_F(RigidHandles, WithUnusedVerticesInThem) {
  expect_rigid({{"a", Eigen::Vector3i(0, 4, 9)}, {"dust", Eigen::VectorXi::Constant(1, 82)}});
}

TEST_F(RigidHandles, EveryVertex) {
  const auto n = static_cast<int>(mesh.vertices.rows());
  expect_rigid({{"all", Eigen::VectorXi::LinSpaced(n, 0, n - 1)}});
}

}  // namespace
}  // namespace supple
