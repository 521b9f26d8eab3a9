// SPDX-License-Identifier: GPL-3.0-or-later
// Other handles on what an editor of before has computed.
#include "native/tasks/editing.h"

namespace supple {
namespace {

class RebindZoo : public ::testing::TestWithParam<zoo::Entry> {
 protected:
  void expect_as_fresh(const Editor& former, const std::vector<Handle>& handles,
                       const std::vector<HandleTarget>& targets, const std::string& what) const {
    const Editor fresh(prepared, handles, network);
    const Editor rebound(prepared, handles, network, {}, &former);
    for (const auto& [name, options] : test::kinds(10)) {
      EXPECT_LT(test::farthest(rebound.solve(targets, options).vertices,
                               fresh.solve(targets, options).vertices),
                1e-6 * test::diagonal(GetParam().mesh.vertices))  // single precision
          << what << ", " << name;
    }
  }
  std::shared_ptr<const PreparedMesh> prepared = test::prepared(GetParam().mesh);
  std::shared_ptr<const LocalJacobianNetwork<float>> network = test::editing_network();
};

TEST_P(RebindZoo, AddedAndRemovedHandles) {
  const Points& vertices = GetParam().mesh.vertices;
  const test::Edit edit = test::bending(vertices, 6);
  // The one vertex in neither that is nearest to the middle of the box's side.
  std::vector<bool> taken(static_cast<size_t>(vertices.rows()), false);
  for (const Handle& handle : edit.handles) {
    for (const int i : handle.vertices) {
      taken[static_cast<size_t>(i)] = true;
    }
  }
  const Eigen::RowVector3d low = vertices.colwise().minCoeff(),
                           high = vertices.colwise().maxCoeff();
  const Eigen::VectorXi order =
      test::handle_at("all", vertices, {low[0], 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2])},
                      static_cast<int>(vertices.rows()))
          .vertices;
  std::vector<int> third;
  for (const int i : order) {
    if (!taken[static_cast<size_t>(i)] && third.size() < 3) {
      third.push_back(i);
    }
  }
  const Handle side{
      "side", Eigen::Map<Eigen::VectorXi>(third.data(), static_cast<Eigen::Index>(third.size()))};
  const std::vector<Handle> three = {edit.handles[0], edit.handles[1], side};
  const Editor of_two(prepared, edit.handles, network), of_three(prepared, three, network);
  HandleTarget pushed;
  pushed.matrix = test::affine(test::rotation(0), 0.1 * (high - low));
  expect_as_fresh(of_two, three, {edit.targets[0], edit.targets[1], pushed}, "added");
  expect_as_fresh(of_three, edit.handles, edit.targets, "removed");
  expect_as_fresh(of_three, {edit.handles[1], side}, {edit.targets[1], pushed}, "first removed");
  // One from another is a former one as well.
  const Editor again(prepared, edit.handles, network, {}, &of_three);
  expect_as_fresh(again, three, {edit.targets[0], edit.targets[1], pushed}, "back again");
}

std::vector<zoo::Entry> shapes() {
  return {{.name = "irregular", .mesh = zoo::perturbed_sphere(3, 2)},
          {.name = "square_tower", .mesh = zoo::square_tower(3, 9)},
          {.name = "torus", .mesh = zoo::torus(24, 14)},
          {.name = "moebius", .mesh = zoo::moebius(24, 4)},
          {.name = "two_spheres", .mesh = zoo::two_spheres(2)},
          {.name = "zero_area", .mesh = zoo::with_zero_area_faces(zoo::icosphere(2))},
          {.name = "unused_vertices", .mesh = zoo::with_unused_vertices(zoo::icosphere(2))}};
}
INSTANTIATE_TEST_SUITE_P(Shapes, RebindZoo, ::testing::ValuesIn(shapes()), test::entry_name);

TEST(Rebind, MoreThanTheMostChangesIsAFactorOfItsOwn) {
  const zoo::Mesh mesh = zoo::perturbed_sphere(3, 2);
  const auto prepared = test::prepared(mesh);
  const test::Edit small = test::bending(mesh.vertices, 6),
                   large = test::bending(mesh.vertices, 90);
  const Editor former(prepared, small.handles, nullptr);
  EXPECT_LT(test::farthest(
                Editor(prepared, large.handles, nullptr, {}, &former).solve(large.targets).vertices,
                Editor(prepared, large.handles, nullptr).solve(large.targets).vertices),
            1e-8 * test::diagonal(mesh.vertices));
}

TEST(Rebind, OfAnotherMeshIsNotUsed) {
  const zoo::Mesh mesh = zoo::perturbed_sphere(2, 2);
  const auto prepared = test::prepared(mesh);
  const test::Edit edit = test::bending(mesh.vertices);
  const Editor former(test::prepared(zoo::icosphere(2)), edit.handles, nullptr);
  EXPECT_EQ(Editor(prepared, edit.handles, nullptr, {}, &former).solve(edit.targets).vertices,
            Editor(prepared, edit.handles, nullptr).solve(edit.targets).vertices);
}

TEST(Rebind, TheFormerOneMayGo) {
  const zoo::Mesh mesh = zoo::perturbed_sphere(2, 2);
  const auto prepared = test::prepared(mesh);
  const test::Edit edit = test::bending(mesh.vertices);
  auto former = std::make_unique<Editor>(prepared, std::vector<Handle>{edit.handles[1]}, nullptr);
  const Editor editor(prepared, edit.handles, nullptr, {}, former.get());
  const Points before = editor.solve(edit.targets).vertices;
  former.reset();
  EXPECT_EQ(editor.solve(edit.targets).vertices, before);
}

}  // namespace
}  // namespace supple
