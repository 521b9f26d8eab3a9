// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/held_system.h"

#include <Eigen/Cholesky>

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

TEST_P(PoissonZoo, TwoCorrectionsAtOnceAreThoseOfEach) {
  const HeldSystem poisson(operators.laplacian, held);
  const Points one = operators.laplacian * test::noise(target.rows(), 3, 1),
               two = operators.laplacian * test::noise(target.rows(), 3, 2);
  const auto [first, second] = poisson.corrections(one, two);
  EXPECT_LT(test::farthest(first, poisson.correction(one)), 1e-4);
  EXPECT_LT(test::farthest(second, poisson.correction(two)), 1e-4);
  EXPECT_EQ(rows_of(second, held), Points::Zero(held.size(), 3));
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

// What the header says, by dense elimination: the free rows' own system.
Points solved_densely(const Eigen::MatrixXd& matrix, const Eigen::VectorXi& held, const Points& rhs,
                      const Points& values) {
  Points result = Points::Zero(rhs.rows(), 3);
  std::vector<int> free;
  std::vector<bool> is_held(static_cast<size_t>(rhs.rows()), false);
  for (Eigen::Index i = 0; i < held.size(); ++i) {
    result.row(held[i]) = values.row(i);
    is_held[static_cast<size_t>(held[i])] = true;
  }
  for (int i = 0; i < rhs.rows(); ++i) {
    if (!is_held[static_cast<size_t>(i)]) {
      free.push_back(i);
    }
  }
  const Eigen::MatrixXd reduced = (rhs - matrix * result)(free, Eigen::all);
  const Eigen::MatrixXd inner = matrix(free, free);
  const Eigen::MatrixXd solution = inner.llt().solve(reduced);
  result(free, Eigen::all) = solution;
  return result;
}

TEST(HeldSystem, OneAnalysisServesEverySetOfHeldRows) {
  const SurfaceOperators operators = operators_of(zoo::perturbed_sphere(2, 7));
  const int n = static_cast<int>(operators.mass.size());
  const Points rhs = test::noise(n, 3, 1);
  for (const Backend backend : {Backend::cholmod, Backend::eigen}) {
    if (!SparseCholesky::available(backend)) {
      continue;
    }
    const auto shared = std::make_shared<const SymbolicCholesky>(operators.laplacian, backend);
    std::vector<HeldSystem> systems;
    const std::vector<Eigen::VectorXi> sets = {
        Eigen::VectorXi::Constant(1, 5), Eigen::Vector3i(n - 1, 0, 17),
        Eigen::VectorXi::LinSpaced(n / 2, 0, 2 * (n / 2 - 1)),
        Eigen::VectorXi::LinSpaced(n, n - 1, 0)};
    for (const Eigen::VectorXi& held : sets) {
      systems.emplace_back(operators.laplacian, held, shared);
    }
    for (size_t s = 0; s < sets.size(); ++s) {
      const Points values = test::noise(sets[s].size(), 3, 2);
      const Points expected =
          solved_densely(Eigen::MatrixXd(operators.laplacian), sets[s], rhs, values);
      EXPECT_LT((systems[s].solve(rhs, values) - expected).norm(), 1e-11 * expected.norm())
          << sets[s].size() << " held";
    }
  }
}

TEST(HeldSystem, TheAnalysisOfAnotherMatrixIsRefused) {
  const SurfaceOperators operators = operators_of(zoo::icosphere(1));
  const auto other =
      std::make_shared<const SymbolicCholesky>(operators_of(zoo::icosphere(2)).laplacian);
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"42", "162"}, [&] {
    HeldSystem(operators.laplacian, Eigen::VectorXi::Zero(1), other);
  }));
}

TEST(HeldSystem, HeldRowsWhoseDiagonalIsNotPositiveAreTakenOut) {
  // The middle of three rows would make the matrix indefinite; held, it is not part of it.
  Eigen::Matrix3d matrix;
  matrix << 2, -1, 0, -1, -5, -1, 0, -1, 2;
  const HeldSystem system(matrix.sparseView(), Eigen::VectorXi::Constant(1, 1));
  const Points got = system.solve(Points::Zero(3, 3), Points::Constant(1, 3, 4.0));
  EXPECT_TRUE(got.row(0).isApproxToConstant(2.0, 1e-15));
  EXPECT_TRUE(got.row(2).isApproxToConstant(2.0, 1e-15));
}

TEST(FreePoisson, OneAnalysisGivesWhatItsOwnGives) {
  for (const zoo::Entry& entry : zoo::all()) {
    const SurfaceOperators o = operators_of(entry.mesh);
    const auto shared = std::make_shared<const SymbolicCholesky>(o.laplacian);
    const FreePoisson with(o.laplacian, o.mass, o.component, o.component_count, shared);
    const FreePoisson without(o.laplacian, o.mass, o.component, o.component_count);
    const Points rhs = test::noise(o.mass.size(), 3, 1);
    EXPECT_EQ(with.solve(rhs), without.solve(rhs)) << entry.name;
  }
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
