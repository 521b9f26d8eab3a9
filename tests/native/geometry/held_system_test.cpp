// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/held_system.h"

#include "native/gradient_check.h"
#include "native/support.h"
#include "supple/geometry/surface_operators.h"

namespace supple {
namespace {

using Backend = SparseCholesky::Backend;

SurfaceOperators operators_of(const zoo::Mesh& mesh) {
  return SurfaceOperators(TriangleMesh(mesh.vertices, mesh.faces));
}

// Two vertices of each component, and every tenth.
Eigen::VectorXi some_held(const SurfaceOperators& operators) {
  std::vector<int> held, of_component(static_cast<size_t>(operators.component_count), 0);
  for (int i = 0; i < operators.component.size(); ++i) {
    int& already = of_component[static_cast<size_t>(operators.component[i])];
    if (already++ < 2 || i % 10 == 0) {
      held.push_back(i);
    }
  }
  return Eigen::Map<Eigen::VectorXi>(held.data(), static_cast<Eigen::Index>(held.size()));
}

Points rows_of(const Points& points, const Eigen::VectorXi& rows) {
  Points result(rows.size(), 3);
  for (Eigen::Index i = 0; i < rows.size(); ++i) {
    result.row(i) = points.row(rows[i]);
  }
  return result;
}

class PoissonZoo : public ::testing::TestWithParam<zoo::Entry> {
 protected:
  PoissonZoo()
      : operators(operators_of(GetParam().mesh)),
        held(some_held(operators)),
        target(test::bent(operators.vertices)) {}
  FreePoisson free() const {
    return {operators.laplacian, operators.mass, operators.component, operators.component_count};
  }

  SurfaceOperators operators;
  Eigen::VectorXi held;
  Points target;
};

TEST_P(PoissonZoo, FreeGivesBackAKnownMap) {
  const FreePoisson poisson = free();
  const Points got = poisson.solve(operators.divergence_of(operators.jacobians_of(target)));
  EXPECT_LT(test::farthest(got, poisson.centred(target)), 1e-9 * test::diagonal(target));
}

TEST_P(PoissonZoo, HeldGivesBackAKnownMap) {
  for (const Backend backend : {Backend::cholmod, Backend::eigen}) {
    if (!SparseCholesky::available(backend)) {
      continue;
    }
    const HeldSystem poisson(
        operators.laplacian, held,
        std::make_shared<const SymbolicCholesky>(operators.laplacian, backend));
    const Points got = poisson.solve(operators.divergence_of(operators.jacobians_of(target)),
                                     rows_of(target, held));
    EXPECT_LT(test::farthest(got, target), 1e-9 * test::diagonal(target));
  }
}

TEST_P(PoissonZoo, HeldRowsAreExact) {
  const HeldSystem poisson(operators.laplacian, held);
  const Points values = test::noise(held.size(), 3, 1);
  const Points got = poisson.solve(test::noise(target.rows(), 3, 2), values);
  EXPECT_EQ(rows_of(got, held), values);
}

TEST_P(PoissonZoo, CentringTakesOutEachComponentsCentroid) {
  const Points centred = free().centred(target);
  for (int c = 0; c < operators.component_count; ++c) {
    const Eigen::VectorXd weight =
        (operators.component.array() == c).cast<double>() * operators.mass.array();
    EXPECT_LT((weight.transpose() * centred).norm(), 1e-13);
  }
  EXPECT_LT(test::farthest(free().centred(centred), centred), 1e-13);
}

// <A x, y> = <x, A^T y>, relative to the sizes that meet in the product.
void expect_adjoint(const Points& ax, const Points& y, const Points& x, const Points& aty) {
  const double forward = ax.cwiseProduct(y).sum(), backward = x.cwiseProduct(aty).sum();
  EXPECT_NEAR(forward, backward, 1e-10 * (ax.norm() * y.norm() + x.norm() * aty.norm()));
}

TEST_P(PoissonZoo, FreeBackwardIsTheAdjoint) {
  const FreePoisson poisson = free();
  const Points x = test::noise(target.rows(), 3, 3), y = test::noise(target.rows(), 3, 4);
  // The pinned vertices' own right-hand side is not read: the equations of a closed piece sum to 0.
  expect_adjoint(poisson.solve(x), y, x, poisson.solve_backward(y));
}

TEST_P(PoissonZoo, HeldBackwardIsTheAdjoint) {
  const HeldSystem poisson(operators.laplacian, held);
  const Points x = test::noise(target.rows(), 3, 3);
  Points y = test::noise(target.rows(), 3, 4);
  const Points zero = Points::Zero(held.size(), 3);
  const Points backward = poisson.solve_backward(y);
  EXPECT_TRUE(rows_of(backward, held).isZero(0.0));
  for (const int i : held) {
    y.row(i).setZero();  // held rows do not depend on the right-hand side
  }
  expect_adjoint(poisson.solve(x, zero), y, x, backward);
}

SUPPLE_OVER_THE_ZOO(PoissonZoo);

TEST(FreePoisson, BackwardAgainstFiniteDifferences) {
  const SurfaceOperators operators = operators_of(zoo::perturbed_sphere(0, 3));
  const FreePoisson poisson(operators.laplacian, operators.mass, operators.component, 1);
  Points rhs = test::noise(operators.vertices.rows(), 3, 1);
  const Points weights = test::noise(rhs.rows(), 3, 2);
  const Points analytic = poisson.solve_backward(weights);
  EXPECT_TRUE(test::gradient_matches([&] { return poisson.solve(rhs).cwiseProduct(weights).sum(); },
                                     test::values_of(rhs), test::values_of(analytic)));
}

TEST(FreePoisson, DoesNotDependOnWhichVertexIsPinned) {
  // A right-hand side in the range (one that comes from Jacobians) has one centred solution;
  // turning the numbering around pins another vertex.
  zoo::Mesh mesh = zoo::perturbed_sphere(1, 3);
  const SurfaceOperators a = operators_of(mesh);
  const auto last = static_cast<int>(mesh.vertices.rows()) - 1;
  mesh.vertices = mesh.vertices.colwise().reverse().eval();
  mesh.faces = last - mesh.faces.array();
  const SurfaceOperators b = operators_of(mesh);
  const Points target = test::bent(a.vertices);
  const FreePoisson pa(a.laplacian, a.mass, a.component, 1),
      pb(b.laplacian, b.mass, b.component, 1);
  const Points from_a = pa.solve(a.divergence_of(a.jacobians_of(target)));
  const Points turned = target.colwise().reverse();
  const Points from_b = pb.solve(b.divergence_of(b.jacobians_of(turned)));
  EXPECT_LT(test::farthest(from_a, from_b.colwise().reverse()), 1e-12);
}

TEST(HeldSystem, BackwardAgainstFiniteDifferences) {
  const SurfaceOperators operators = operators_of(zoo::perturbed_sphere(0, 3));
  const HeldSystem poisson(operators.laplacian, Eigen::Vector3i(4, 0, 7));
  const Points values = test::noise(3, 3, 5);
  Points rhs = test::noise(operators.vertices.rows(), 3, 1);
  const Points weights = test::noise(rhs.rows(), 3, 2);
  const Points analytic = poisson.solve_backward(weights);
  EXPECT_TRUE(
      test::gradient_matches([&] { return poisson.solve(rhs, values).cwiseProduct(weights).sum(); },
                             test::values_of(rhs), test::values_of(analytic)));
}

TEST(HeldSystem, EveryRowHeld) {
  const SurfaceOperators operators = operators_of(zoo::tetrahedron());
  const HeldSystem poisson(operators.laplacian, Eigen::Vector4i(3, 1, 0, 2));
  const Points values = test::noise(4, 3, 1);
  const Points got = poisson.solve(Points::Zero(4, 3), values);
  EXPECT_EQ(got.row(3), values.row(0));
  EXPECT_EQ(got.row(2), values.row(3));
}

TEST(HeldSystem, HarmonicMeanOfAHandMadeChain) {
  // A path 0-1-2 with unit weights: the middle is the mean of its held neighbours plus half its
  // rhs.
  const Eigen::Matrix3d path = (Eigen::Matrix3d() << 1, -1, 0, -1, 2, -1, 0, -1, 1).finished();
  const HeldSystem system(path.sparseView(), Eigen::Vector2i(0, 2));
  const Points values = (Points(2, 3) << 0, 0, 0, 2, 4, 6).finished();
  Points rhs = Points::Zero(3, 3);
  rhs.row(1) << 1, 1, 1;
  EXPECT_TRUE(system.solve(rhs, values).row(1).isApprox(Eigen::RowVector3d(1.5, 2.5, 3.5), 1e-14));
}

TEST(HeldSystem, IndexOutOfRange) {
  const SurfaceOperators operators = operators_of(zoo::tetrahedron());
  for (const int bad : {4, -1}) {
    EXPECT_TRUE(test::fails_with(
        ErrorCode::index_out_of_range, {std::to_string(bad).c_str(), "4 rows"},
        [&] { HeldSystem(operators.laplacian, Eigen::VectorXi::Constant(1, bad)); }));
  }
}

TEST(HeldSystem, NothingHeldIsNotDefinite) {
  Eigen::Matrix2d path;
  path << 1, -1, -1, 1;
  EXPECT_TRUE(test::fails_with(ErrorCode::not_positive_definite, {},
                               [&] { HeldSystem(path.sparseView(), Eigen::VectorXi()); }));
}

}  // namespace
}  // namespace supple
