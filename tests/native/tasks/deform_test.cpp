// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/tasks/deform.h"

#include <limits>

#include "native/learning/networks.h"
#include "supple/geometry/held_system.h"

namespace supple {
namespace {

class Deform : public ::testing::TestWithParam<zoo::Entry> {
 protected:
  static constexpr int kCount = 24;
  const zoo::Mesh& mesh() const { return GetParam().mesh; }
  static LocalJacobianNetwork<float> awake() {
    const test::RestMesh<float> rest(zoo::perturbed_sphere(2, 3), 64, 0);
    const Points target = test::bent(rest.operators.vertices);
    return test::awake_network<float>(
        {.signal = SignalKind::spectral, .eigenfunctions = 64, .width = 32}, 5, rest.context,
        test::signal_of(SignalKind::spectral, rest, target, kCount), 0.05);
  }
  void expect_turned(const LocalJacobianNetwork<float>* network, double tolerance) const {
    const Points target = test::bent(mesh().vertices);
    const PreparedMesh prepared(mesh().vertices, mesh().faces,
                                {.eigenfunctions = 64, .samples = 200});
    const Points expected = deform(prepared, target, kCount, network);
    for (uint64_t which = 0; which < 2; ++which) {
      const Matrix3 r1 = test::rotation(which), r2 = test::rotation(which + 3);
      const Eigen::RowVector3d shift(0.3, 0.7, -0.4);
      const PreparedMesh turned(Points(mesh().vertices * r1), mesh().faces,
                                {.eigenfunctions = 64, .samples = 200});
      const Points got = deform(turned, Points((target * r2).rowwise() + shift), kCount, network);
      EXPECT_LT(test::farthest(got, (expected * r2).rowwise() + shift),
                tolerance * test::diagonal(target))
          << "rotation " << which;
    }
  }
};

TEST_P(Deform, TurnsWithSourceAndTargetWithoutANetwork) { expect_turned(nullptr, 1e-7); }

TEST_P(Deform, TurnsWithSourceAndTargetWithANetwork) {
  const LocalJacobianNetwork<float> network = awake();
  expect_turned(&network, 1e-4);
}

TEST_P(Deform, KeepsEveryComponentsCentroid) {
  const Points target = test::bent(mesh().vertices);
  const PreparedMesh prepared(mesh().vertices, mesh().faces, {.eigenfunctions = 64});
  const LocalJacobianNetwork<float> network = awake();
  const Points got = deform(prepared, target, kCount, &network);
  const SurfaceOperators& operators = prepared.operators;
  const FreePoisson poisson(operators.laplacian, operators.mass, operators.component,
                            operators.component_count);
  const Points difference = got - target;
  EXPECT_LT(test::farthest(difference, poisson.centred(difference)), 1e-9 * test::diagonal(target));
}

std::vector<zoo::Entry> shapes() {
  return {{.name = "irregular", .mesh = zoo::perturbed_sphere(3, 2)},
          {.name = "icosphere", .mesh = zoo::icosphere(3)},
          {.name = "square_tower", .mesh = zoo::square_tower(3, 9)},
          {.name = "cylinder", .mesh = zoo::open_cylinder(20, 14)},
          {.name = "two_spheres", .mesh = zoo::two_spheres(2)}};
}
INSTANTIATE_TEST_SUITE_P(Shapes, Deform, ::testing::ValuesIn(shapes()), test::entry_name);

class DeformZoo : public ::testing::TestWithParam<zoo::Entry> {};

TEST_P(DeformZoo, WithEveryFunctionTheTargetComesBack) {
  const zoo::Mesh& mesh = GetParam().mesh;
  const auto n = static_cast<int>(mesh.vertices.rows());
  const PreparedMesh prepared(mesh.vertices, mesh.faces, {.eigenfunctions = n});
  const Points target = test::bent(mesh.vertices);
  // The same faces must have an area on both sides.
  const Points got = deform(prepared, target, n, nullptr);
  for (const int i : prepared.mesh.mesh_vertex()) {
    EXPECT_LT((got.row(i) - target.row(i)).norm(), 1e-8 * test::diagonal(target)) << "vertex " << i;
  }
}

TEST_P(DeformZoo, WithFewFunctionsTheAnswerIsFinite) {
  const zoo::Mesh& mesh = GetParam().mesh;
  const PreparedMesh prepared(mesh.vertices, mesh.faces, {.eigenfunctions = 20});
  const Points target = 1.5 * mesh.vertices * test::rotation(1);
  EXPECT_TRUE(deform(prepared, target, 12, nullptr).allFinite());
}

std::vector<zoo::Entry> without_degenerate_faces() {
  // Bending gives points on a line an area; the pair has other faces then (see the error below).
  std::vector<zoo::Entry> result;
  for (const zoo::Entry& entry : zoo::all()) {
    if (entry.degenerate_faces == 0) {
      result.push_back(entry);
    }
  }
  return result;
}
INSTANTIATE_TEST_SUITE_P(Zoo, DeformZoo, ::testing::ValuesIn(without_degenerate_faces()),
                         test::entry_name);

class DeformErrors : public ::testing::Test {
 protected:
  ::testing::AssertionResult fails(ErrorCode code, std::initializer_list<const char*> parts,
                                   int count = 10,
                                   const LocalJacobianNetwork<float>* network = nullptr) {
    return test::fails_with(code, parts, [&] { deform(prepared, target, count, network); });
  }
  zoo::Mesh mesh = zoo::perturbed_sphere(1, 3);
  PreparedMesh prepared{mesh.vertices, mesh.faces, {.eigenfunctions = 20}};
  Points target = test::bent(mesh.vertices);
};

TEST_F(DeformErrors, ATargetOfAnotherSize) {
  target.conservativeResize(41, 3);
  EXPECT_TRUE(fails(ErrorCode::wrong_shape, {"41", "42"}));
}

TEST_F(DeformErrors, ATargetThatIsNotFinite) {
  target(7, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(fails(ErrorCode::not_finite, {"Vertex 7"}));
}

TEST_F(DeformErrors, ATargetWithOtherFacesWithoutArea) {
  // The fan around vertex 0 falls together, so that vertex has no face left.
  for (Eigen::Index f = 0; f < mesh.faces.rows(); ++f) {
    for (int c = 0; c < 3; ++c) {
      if ((mesh.faces.row(f).array() == 0).any()) {
        target.row(mesh.faces(f, c)) = target.row(0);
      }
    }
  }
  EXPECT_TRUE(fails(ErrorCode::wrong_shape, {"area"}));
}

TEST_F(DeformErrors, ANetworkOfTheOtherSignal) {
  const LocalJacobianNetwork<float> network({.eigenfunctions = 20, .width = 8}, 1);
  EXPECT_TRUE(fails(ErrorCode::bad_option, {"rotations"}, 10, &network));
}

TEST_F(DeformErrors, NoEigenfunctions) {
  EXPECT_TRUE(fails(ErrorCode::bad_option, {"0"}, 0));
  EXPECT_TRUE(fails(ErrorCode::bad_option, {"-3"}, -3));
}

TEST_F(DeformErrors, Cancelled) {
  Progress progress;
  progress.cancel();
  EXPECT_TRUE(test::fails_with(ErrorCode::cancelled, {}, [&] {
    deform(prepared, target, 10, nullptr, ProgressRange(&progress));
  }));
}

}  // namespace
}  // namespace supple
