// SPDX-License-Identifier: GPL-3.0-or-later
// Turning the rest mesh by one rotation and the handles' world by another turns the result with
// them, to 1e-4 of the bounding box.
#include "native/tasks/editing.h"

namespace supple {
namespace {

class EditEquivariance : public ::testing::TestWithParam<zoo::Entry> {
 protected:
  void expect_turned(const std::shared_ptr<const LocalJacobianNetwork<float>>& network,
                     double tolerance) const {
    const zoo::Mesh& mesh = GetParam().mesh;
    const test::Edit edit = test::bending(mesh.vertices, mesh.vertices.rows() < 12 ? 2 : 6);
    const double size = test::diagonal(mesh.vertices);
    for (const auto& [name, options] : test::kinds(5)) {
      const Points expected = Editor(test::prepared(mesh, 64), edit.handles, network)
                                  .solve(edit.targets, options)
                                  .vertices;
      for (uint64_t which = 0; which < 2; ++which) {
        const Matrix3 r1 = test::rotation(which), r2 = test::rotation(which + 3);
        const Eigen::RowVector3d shift = size * Eigen::RowVector3d(0.3, 0.7, -0.4);
        const Eigen::Matrix4d world = test::affine(r2, shift);
        const Eigen::Matrix4d back = test::affine(r1.transpose(), {0, 0, 0});
        std::vector<HandleTarget> targets;
        for (const HandleTarget& target : edit.targets) {
          const Eigen::Matrix4d matrix = target.matrix.value_or(Eigen::Matrix4d::Identity());
          targets.push_back({.matrix = world * matrix * back, .positions = {}});
        }
        const auto turned = test::prepared({mesh.vertices * r1, mesh.faces}, 64);
        const Points got = Editor(turned, edit.handles, network).solve(targets, options).vertices;
        const Points wanted = (expected * r2).rowwise() + shift;
        EXPECT_LT(test::farthest(got, wanted), tolerance * size) << name << ", rotation " << which;
      }
    }
  }
};

TEST_P(EditEquivariance, WithoutANetwork) { expect_turned(nullptr, 1e-6); }
TEST_P(EditEquivariance, WithANetwork) { expect_turned(test::editing_network(64), 1e-4); }

std::vector<zoo::Entry> shapes() {
  return {{.name = "irregular", .mesh = zoo::perturbed_sphere(3, 2)},
          {.name = "icosphere", .mesh = zoo::icosphere(3)},
          {.name = "square_tower", .mesh = zoo::square_tower(3, 9)},
          {.name = "cylinder", .mesh = zoo::open_cylinder(20, 14)},
          {.name = "torus", .mesh = zoo::torus(24, 14)},
          {.name = "two_spheres", .mesh = zoo::two_spheres(2)},
          {.name = "many_pieces", .mesh = zoo::many_pieces(12)},
          {.name = "few_vertices", .mesh = zoo::cube()},
          {.name = "unused_vertices", .mesh = zoo::with_unused_vertices(zoo::icosphere(2))}};
}
INSTANTIATE_TEST_SUITE_P(Shapes, EditEquivariance, ::testing::ValuesIn(shapes()), test::entry_name);

}  // namespace
}  // namespace supple
