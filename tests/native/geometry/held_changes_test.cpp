// SPDX-License-Identifier: GPL-3.0-or-later
// Other rows held on the factor that is there, against a factor of their own.
#include <numeric>

#include "native/support.h"
#include "supple/geometry/held_system.h"
#include "supple/geometry/surface_operators.h"

namespace supple {
namespace {

SurfaceOperators operators_of(const zoo::Mesh& mesh) {
  return SurfaceOperators(TriangleMesh(mesh.vertices, mesh.faces));
}

Eigen::VectorXi vector_of(const std::vector<int>& values) {
  return Eigen::Map<const Eigen::VectorXi>(values.data(), static_cast<Eigen::Index>(values.size()));
}

// The `which`-th vertex of each component (or its last), then every `step`-th of all.
std::vector<int> some(const SurfaceOperators& operators, int which, int step) {
  std::vector<std::vector<int>> of(static_cast<size_t>(operators.component_count));
  for (int i = 0; i < operators.component.size(); ++i) {
    of[static_cast<size_t>(operators.component[i])].push_back(i);
  }
  std::vector<int> result;
  std::vector<bool> taken(static_cast<size_t>(operators.component.size()), false);
  const auto take = [&](int i) {
    if (!taken[static_cast<size_t>(i)]) {
      taken[static_cast<size_t>(i)] = true;
      result.push_back(i);
    }
  };
  for (const std::vector<int>& vertices : of) {
    take(vertices[std::min(static_cast<size_t>(which), vertices.size() - 1)]);
  }
  for (int i = which; i < operators.component.size(); i += step) {
    take(i);
  }
  return result;
}

Points values_everywhere(const SurfaceOperators& operators) {
  return test::bent(operators.vertices) - operators.vertices;
}

// Both are solves of one system, each accurate to its condition times 1e-16.
void expect_as_fresh(const SurfaceOperators& operators, const HeldSystem& changed,
                     const Eigen::VectorXi& held, const std::string& name) {
  ASSERT_EQ(changed.held(), held) << name;
  const HeldSystem fresh(operators.laplacian, held);
  const Points rhs = test::noise(operators.mass.size(), 3, 1);
  const Points values = test::noise(held.size(), 3, 2);
  const Points got = changed.solve(rhs, values), expected = fresh.solve(rhs, values);
  EXPECT_LT((got - expected).norm(), 1e-10 * expected.norm()) << name;
  for (Eigen::Index i = 0; i < held.size(); ++i) {
    EXPECT_EQ(got.row(held[i]), values.row(i)) << name << ", held row " << i;
  }
  // In single precision, and with rows of the right-hand side that were held once.
  const Points force = operators.laplacian * values_everywhere(operators);
  const auto [one, two] = changed.corrections(force, 2.0 * force);
  const Points expected_change = fresh.solve(force, Points::Zero(held.size(), 3));
  EXPECT_LT((one - expected_change).norm(), 1e-3 * expected_change.norm()) << name;
  EXPECT_LT((two - 2.0 * expected_change).norm(), 2e-3 * expected_change.norm()) << name;
  const Points back = changed.solve_backward(rhs), back_expected = fresh.solve_backward(rhs);
  EXPECT_LE((back - back_expected).norm(), 1e-10 * back_expected.norm()) << name;
}

class HeldChangesZoo : public ::testing::TestWithParam<zoo::Entry> {
 protected:
  void expect_change(const std::vector<int>& from, const std::vector<int>& to,
                     const std::string& name) const {
    const HeldSystem base(operators.laplacian, vector_of(from));
    const std::optional<HeldSystem> changed = base.changed(vector_of(to));
    ASSERT_TRUE(changed.has_value()) << name;
    expect_as_fresh(operators, *changed, vector_of(to), name);
  }
  SurfaceOperators operators = operators_of(GetParam().mesh);
};

TEST_P(HeldChangesZoo, Added) {
  const std::vector<int> few = some(operators, 0, 40);
  std::vector<int> more = few;
  for (const int i : some(operators, 2, 23)) {
    if (std::find(few.begin(), few.end(), i) == few.end()) {
      more.insert(more.begin() + static_cast<long>(more.size() / 2), i);
    }
  }
  expect_change(few, more, "added");
  expect_change(more, few, "taken out");
}

TEST_P(HeldChangesZoo, AllOthers) {
  expect_change(some(operators, 0, 31), some(operators, 1, 17), "all others");
  expect_change(some(operators, 3, 19), some(operators, 0, 1000), "one a component");
}

SUPPLE_OVER_THE_ZOO(HeldChangesZoo);

class HeldChanges : public ::testing::Test {
 protected:
  Eigen::VectorXi range(int first, int count) const {
    return Eigen::VectorXi::LinSpaced(count, first, first + count - 1);
  }
  SurfaceOperators operators = operators_of(zoo::perturbed_sphere(3, 5));  // 642
};

TEST_F(HeldChanges, NeighboursThatMeetInTheMatrix) {
  // Rows of one face: freed together and added together they couple directly.
  const Faces& f = operators.faces;
  const Eigen::VectorXi a = f.row(0).transpose(), b = f.row(40).transpose();
  const HeldSystem base(operators.laplacian, a);
  expect_as_fresh(operators, base.changed(b).value(), b, "another face");
  const Eigen::VectorXi one = a.tail(1);
  expect_as_fresh(operators, base.changed(one).value(), one, "a corner of it");
}

TEST_F(HeldChanges, OnlyTheirOrder) {
  const HeldSystem base(operators.laplacian, Eigen::Vector4i(3, 500, 77, 12));
  const Eigen::Vector4i turned(77, 3, 12, 500);
  const HeldSystem changed = base.changed(turned).value();
  expect_as_fresh(operators, changed, turned, "turned");
  const Points rhs = test::noise(operators.mass.size(), 3, 1), values = test::noise(4, 3, 2);
  Points other(4, 3);
  other << values.row(1), values.row(3), values.row(0), values.row(2);
  EXPECT_LT((base.solve(rhs, other) - changed.solve(rhs, values)).norm(),
            1e-12 * changed.solve(rhs, values).norm());
}

TEST_F(HeldChanges, NoneIsTheSystemItself) {
  const HeldSystem base(operators.laplacian, range(10, 5));
  const Points rhs = test::noise(operators.mass.size(), 3, 1), values = test::noise(5, 3, 2);
  EXPECT_EQ(base.changed(range(10, 5))->solve(rhs, values), base.solve(rhs, values));
}

TEST_F(HeldChanges, OfChangesAreChangesOfWhatWasFactored) {
  const HeldSystem base(operators.laplacian, range(10, 40));
  const HeldSystem once = base.changed(range(30, 40)).value();
  const HeldSystem twice = once.changed(range(50, 20)).value();
  expect_as_fresh(operators, twice, range(50, 20), "twice");
  const HeldSystem back = twice.changed(range(10, 40)).value();
  const Points rhs = test::noise(operators.mass.size(), 3, 1), values = test::noise(40, 3, 2);
  EXPECT_EQ(back.solve(rhs, values), base.solve(rhs, values));
}

TEST_F(HeldChanges, UpToTheMost) {
  constexpr auto most = static_cast<int>(HeldSystem::kMostChanges);
  const HeldSystem base(operators.laplacian, range(10, 60));
  const Eigen::VectorXi added = range(10, 60 + most);
  expect_as_fresh(operators, base.changed(added).value(), added, "added");
  EXPECT_FALSE(base.changed(range(10, 61 + most)).has_value());
  // 40 freed and 56 added; one more of either is too many.
  const Eigen::VectorXi both = range(50, 20 + most - 40);
  expect_as_fresh(operators, base.changed(both).value(), both, "both");
  EXPECT_FALSE(base.changed(range(50, 21 + most - 40)).has_value());
  EXPECT_FALSE(base.changed(range(51, 20 + most - 40)).has_value());
  // What counts is the difference to what was factored, not to the last change.
  EXPECT_FALSE(base.changed(added)->changed(range(10, 61 + most)).has_value());
}

TEST_F(HeldChanges, Errors) {
  const HeldSystem base(operators.laplacian, range(10, 5));
  EXPECT_TRUE(test::fails_with(ErrorCode::index_out_of_range, {"642"},
                               [&] { base.changed(Eigen::Vector2i(0, 642)); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::overlapping_handles, {"7", "twice"},
                               [&] { base.changed(Eigen::Vector2i(7, 7)); }));
}

TEST_F(HeldChanges, NeverASystemWithoutASolution) {
  // A component that nothing holds any more: no factor beside can help.
  const SurfaceOperators two = operators_of(zoo::two_spheres(1));
  const HeldSystem base(two.laplacian, Eigen::Vector4i(0, 5, 42, 60));
  for (const Eigen::VectorXi& held :
       {Eigen::VectorXi(Eigen::Vector2i(0, 5)), Eigen::VectorXi(Eigen::Vector2i(0, 7))}) {
    EXPECT_FALSE(base.changed(held).has_value());
  }
  EXPECT_TRUE(base.changed(Eigen::Vector2i(7, 50)).has_value());
}

TEST_F(HeldChanges, OfBothBackends) {
  for (const CholeskyBackend backend : {CholeskyBackend::cholmod, CholeskyBackend::eigen}) {
    if (SparseCholesky::available(backend)) {
      const HeldSystem base(operators.laplacian, range(100, 30),
                            std::make_shared<const SymbolicCholesky>(operators.laplacian, backend));
      expect_as_fresh(operators, base.changed(range(120, 30)).value(), range(120, 30),
                      backend == CholeskyBackend::eigen ? "eigen" : "cholmod");
    }
  }
}

}  // namespace
}  // namespace supple
