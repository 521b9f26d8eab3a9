// SPDX-License-Identifier: GPL-3.0-or-later
#include "tasks/edit/descent.h"

#include "native/support.h"
#include "supple/geometry/jacobians.h"

namespace supple {
namespace {

double value_of(const DeformationEnergy& energy, const Points& moved) {
  Points gradient;
  return energy.evaluate(moved, gradient);
}

// The textbook's alternation for ARAP: a rotation for each vertex, then one Poisson solve.
Points local_global(const SurfaceOperators& operators, const HeldSystem& poisson,
                    const Points& moved, const Points& held) {
  const MatrixField jacobians = operators.jacobians_of(moved);
  MatrixField sums = MatrixField::Zero(moved.rows(), 9);
  for (Eigen::Index f = 0; f < jacobians.rows(); ++f) {
    // The tangential part: the unit normal's row goes.
    const Eigen::RowVector3d normal = operators.face_normals.row(f);
    Matrix3 t = matrix_at(jacobians, f);
    t -= normal.transpose() * (normal * t);
    for (const int v : operators.faces.row(f)) {
      matrix_at(sums, v) += operators.face_areas[f] * t;
    }
  }
  MatrixField targets = MatrixField::Zero(jacobians.rows(), 9);
  for (Eigen::Index f = 0; f < jacobians.rows(); ++f) {
    for (const int v : operators.faces.row(f)) {
      matrix_at(targets, f) += closest_rotation(matrix_at(sums, v)) / 3.0;
    }
  }
  return poisson.solve(operators.divergence_of(targets), held);
}

class DescentTest : public ::testing::TestWithParam<zoo::Entry> {
 protected:
  DescentTest() : operators(TriangleMesh(GetParam().mesh.vertices, GetParam().mesh.faces)) {
    // The lowest and the highest tenth along z of the surface are held.
    const Eigen::VectorXd z = operators.vertices.col(2);
    const double low = z.minCoeff(), high = z.maxCoeff();
    std::vector<int> rows;
    for (int i = 0; i < z.size(); ++i) {
      if (z[i] < low + 0.1 * (high - low) || z[i] > high - 0.1 * (high - low)) {
        rows.push_back(i);
      }
    }
    held = Eigen::Map<Eigen::VectorXi>(rows.data(), static_cast<Eigen::Index>(rows.size()));
    poisson = std::make_unique<HeldSystem>(operators.laplacian, held);
    const Points target = test::bent(operators.vertices);
    values.resize(held.size(), 3);
    for (Eigen::Index i = 0; i < held.size(); ++i) {
      values.row(i) = target.row(held[i]);
    }
    start = target + 0.02 * test::noise(target.rows(), 3, 3);
    for (Eigen::Index i = 0; i < held.size(); ++i) {
      start.row(held[i]) = values.row(i);
    }
  }

  void expect_less_every_pass(const DeformationEnergy& energy) const {
    Points moved = start;
    Descent descent(energy, *poisson);
    double value = value_of(energy, moved);
    const double first = value;
    for (int pass = 0; pass < 60 && !descent.converged(); ++pass) {
      descent.pass(moved);
      const double next = value_of(energy, moved);
      EXPECT_LE(next, value) << "pass " << pass;
      if (!descent.converged()) {
        EXPECT_LT(next, value) << "pass " << pass;
      }
      value = next;
      for (Eigen::Index i = 0; i < held.size(); ++i) {
        ASSERT_EQ(moved.row(held[i]), values.row(i)) << "pass " << pass;
      }
    }
    EXPECT_LT(value, 0.9 * first);
  }

  SurfaceOperators operators;
  Eigen::VectorXi held;
  std::unique_ptr<HeldSystem> poisson;
  Points values, start;
};

TEST_P(DescentTest, EveryPassLowersArap) { expect_less_every_pass(ArapEnergy(operators)); }
TEST_P(DescentTest, EveryPassLowersStiff) { expect_less_every_pass(StiffEnergy(operators)); }

TEST_P(DescentTest, TheFirstArapPassIsALocalGlobalStep) {
  const ArapEnergy energy(operators);
  Points moved = start;
  Descent(energy, *poisson).pass(moved);
  // Of passes, the solve is in single precision.
  EXPECT_LT(test::farthest(moved, local_global(operators, *poisson, start, values)), 1e-6);
}

TEST_P(DescentTest, ReachesTheMinimumOfManyLocalGlobalStepsInFew) {
  const ArapEnergy energy(operators);
  // From far: the mesh at rest but for what is held.
  Points far = operators.vertices;
  for (Eigen::Index i = 0; i < held.size(); ++i) {
    far.row(held[i]) = values.row(i);
  }
  Points slow = far;  // in 30 steps it is within the millionth that is asked below
  for (int step = 0; step < 300; ++step) {
    slow = local_global(operators, *poisson, slow, values);
  }
  const double least = value_of(energy, slow), enough = least * (1.0 + 1e-6);
  int steps = 0;
  for (slow = far; value_of(energy, slow) > enough; ++steps) {
    slow = local_global(operators, *poisson, slow, values);
  }
  Points moved = far;
  Descent descent(energy, *poisson);
  int passes = 0;
  for (; passes < 200 && value_of(energy, moved) > enough; ++passes) {
    descent.pass(moved);
  }
  EXPECT_LE(value_of(energy, moved), enough);
  EXPECT_LE(passes, 15);
  EXPECT_LE(2 * passes, steps);
}

TEST_P(DescentTest, SaysWhenItHasConverged) {
  const ArapEnergy energy(operators);
  Points moved = start;
  Descent descent(energy, *poisson);
  EXPECT_FALSE(descent.converged());
  int passes = 0;
  while (!descent.converged() && passes < 500) {
    descent.pass(moved);
    ++passes;
  }
  EXPECT_TRUE(descent.converged());
  const double value = value_of(energy, moved);
  for (int pass = 0; pass < 100; ++pass) {
    descent.pass(moved);
  }
  EXPECT_NEAR(value_of(energy, moved), value, 1e-4 * value);
}

TEST_P(DescentTest, ForgottenItBeginsAnew) {
  const ArapEnergy energy(operators);
  Descent used(energy, *poisson), fresh(energy, *poisson);
  Points moved = start;
  for (int pass = 0; pass < 5; ++pass) {
    used.pass(moved);
  }
  used.forget();
  Points a = start, b = start;
  for (int pass = 0; pass < 5; ++pass) {
    used.pass(a);
    fresh.pass(b);
  }
  EXPECT_EQ(a, b);
}

std::vector<zoo::Entry> shapes() {
  return {{.name = "irregular", .mesh = zoo::perturbed_sphere(2, 2)},
          {.name = "tower", .mesh = zoo::square_tower(2, 6)},
          {.name = "cylinder", .mesh = zoo::open_cylinder(12, 10)},
          {.name = "sheets", .mesh = zoo::three_sheets(5)}};
}
INSTANTIATE_TEST_SUITE_P(Shapes, DescentTest, ::testing::ValuesIn(shapes()), test::entry_name);

}  // namespace
}  // namespace supple
