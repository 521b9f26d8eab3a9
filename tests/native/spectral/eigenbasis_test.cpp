// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/spectral/eigenbasis.h"

#include <numbers>
#include <thread>

#include "native/support.h"
#include "supple/geometry/operators.h"
#include "supple/geometry/surface_operators.h"

namespace supple {
namespace {

SurfaceOperators operators_of(const zoo::Mesh& mesh) {
  return SurfaceOperators(TriangleMesh(mesh.vertices, mesh.faces));
}

Eigenbasis basis_of(const SurfaceOperators& operators, int count, ProgressRange progress = {}) {
  return eigenbasis(operators.laplacian, operators.mass, {.count = count}, progress);
}

double orthonormality_error(const Eigenbasis& basis) {
  const Eigen::MatrixXd gram =
      basis.functions.transpose() * basis.mass.asDiagonal() * basis.functions;
  return (gram - Eigen::MatrixXd::Identity(gram.rows(), gram.cols())).cwiseAbs().maxCoeff();
}

// |M^-1/2 (W phi - lambda M phi)| / max(lambda, 1), from the returned functions alone.
double recomputed_residual(const SparseMatrix& laplacian, const Eigenbasis& basis) {
  double worst = 0.0;
  for (Eigen::Index k = 0; k < basis.size(); ++k) {
    const Eigen::VectorXd phi = basis.functions.col(k);
    const Eigen::VectorXd r = laplacian * phi - basis.values[k] * basis.mass.cwiseProduct(phi);
    worst = std::max(
        worst, r.cwiseQuotient(basis.mass.cwiseSqrt()).norm() / std::max(basis.values[k], 1.0));
  }
  return worst;
}

class EigenbasisZoo : public ::testing::TestWithParam<zoo::Entry> {};

TEST_P(EigenbasisZoo, IsOrthonormalAndSolvesTheEquation) {
  const SurfaceOperators operators = operators_of(GetParam().mesh);
  const auto n = static_cast<int>(operators.mass.size());
  // Fewer functions than a third of the vertices: Lanczos where the mesh is big enough for it; all
  // the paper's 128: the dense way here.
  for (const int count : {16, 128}) {
    const Eigenbasis basis = basis_of(operators, count);
    EXPECT_EQ(basis.size(), std::min(count, n));
    EXPECT_EQ(basis.functions.rows(), n);
    EXPECT_LT(orthonormality_error(basis), 1e-8) << count << " functions";
    EXPECT_LT(recomputed_residual(operators.laplacian, basis), 1e-8) << count << " functions";
    EXPECT_LE(basis.residual, 1e-8) << count << " functions";
    EXPECT_GE(basis.values.minCoeff(), 0.0);
    for (Eigen::Index k = 1; k < basis.size(); ++k) {
      EXPECT_GE(basis.values[k], basis.values[k - 1] * (1.0 - 1e-12));
    }
  }
}

TEST_P(EigenbasisZoo, HasOneZeroEigenvalueAComponent) {
  const Eigenbasis basis = basis_of(operators_of(GetParam().mesh), 16);
  const Eigen::Index components = std::min<Eigen::Index>(GetParam().components, basis.size());
  EXPECT_LT(basis.values[components - 1], 1e-8);
  if (basis.size() > components) {
    EXPECT_GT(basis.values[components], 1e-3);
  }
}

TEST_P(EigenbasisZoo, ProjectionIsIdempotent) {
  const Eigenbasis basis = basis_of(operators_of(GetParam().mesh), 16);
  const RowMatrix<double> field = test::noise(basis.mass.size(), 5, 1);
  const Eigen::Index count = std::min<Eigen::Index>(9, basis.size());
  const RowMatrix<double> once = basis.project(field, count);
  EXPECT_LT((basis.project(once, count) - once).norm(), 1e-10 * once.norm());
  EXPECT_TRUE(basis.expand(basis.coefficients(field, count)).isApprox(once, 1e-12));
}

SUPPLE_OVER_THE_ZOO(EigenbasisZoo);

TEST(Eigenbasis, EigenvaluesOfTheSphere) {
  const zoo::Mesh mesh = zoo::icosphere(4);
  const SparseMatrix laplacian = cotan_laplacian(mesh.vertices, mesh.faces);
  const Eigenbasis basis =
      eigenbasis(laplacian, lumped_mass(mesh.vertices, mesh.faces), {.count = 25});
  // l (l + 1), each 2 l + 1 times, to the discretisation's error.
  Eigen::Index k = 0;
  for (int l = 0; l < 5; ++l) {
    for (int m = -l; m <= l; ++m, ++k) {
      EXPECT_NEAR(basis.values[k], l * (l + 1), 0.01 * l * (l + 1) + 1e-9) << "eigenvalue " << k;
    }
  }
}

TEST(Eigenbasis, ScaleIsOneOverArea) {
  const zoo::Mesh mesh = zoo::icosphere(3);
  const Eigenbasis basis = basis_of(operators_of(mesh), 5);
  // Unit area: a sphere of radius 1 / sqrt(4 pi).
  EXPECT_NEAR(basis.values[1], 2.0 * 4.0 * std::numbers::pi, 0.3);
}

TEST(Eigenbasis, LanczosAgreesWithTheDenseWay) {
  const SurfaceOperators operators = operators_of(zoo::perturbed_sphere(2, 7));  // 162 vertices
  const Eigenbasis few = basis_of(operators, 20), all = basis_of(operators, 162);
  EXPECT_LT((few.values - all.values.head(20)).cwiseAbs().maxCoeff(), 1e-9 * few.values.maxCoeff());
  const RowMatrix<double> field = test::noise(162, 3, 1);
  EXPECT_LT((few.project(field, 20) - all.project(field, 20)).norm(), 1e-7 * field.norm());
}

TEST(Eigenbasis, TwoIdenticalComponentsGiveEveryEigenvalueTwice) {
  // The copies have the same numbers to the last bit, so nothing but the count finds the second
  // ones.
  const zoo::Mesh one = zoo::perturbed_sphere(2, 7);
  const zoo::Mesh two = zoo::joined(one, zoo::moved(one, {4, 0, 0}));
  const Eigen::VectorXd single = eigenbasis(cotan_laplacian(one.vertices, one.faces),
                                            lumped_mass(one.vertices, one.faces), {.count = 162})
                                     .values;
  for (const int count : {7, 20, 40}) {
    const Eigenbasis basis = eigenbasis(cotan_laplacian(two.vertices, two.faces),
                                        lumped_mass(two.vertices, two.faces), {.count = count});
    for (int k = 0; k < count; ++k) {
      EXPECT_NEAR(basis.values[k], single[k / 2], 1e-8 * std::max(1.0, single[k / 2]))
          << "eigenvalue " << k << " of " << count;
    }
    EXPECT_LT(orthonormality_error(basis), 1e-8);
  }
}

TEST(Eigenbasis, MoreComponentsThanFunctions) {
  const Eigenbasis basis = basis_of(operators_of(zoo::many_pieces(30)), 10);
  EXPECT_EQ(basis.size(), 10);
  EXPECT_LT(basis.values.maxCoeff(), 1e-8);
  EXPECT_LT(orthonormality_error(basis), 1e-8);
}

TEST(Eigenbasis, AsManyFunctionsAsVertices) {
  const SurfaceOperators operators = operators_of(zoo::cube());
  const Eigenbasis basis = basis_of(operators, 128);
  ASSERT_EQ(basis.size(), 8);
  // Complete: projection changes nothing.
  const RowMatrix<double> field = test::noise(8, 2, 1);
  EXPECT_LT((basis.project(field, 8) - field).norm(), 1e-12);
}

// A space of some 900 dimensions, of whose blocks two in five are not compared with all before.
TEST(Eigenbasis, SlowManyFunctionsStayOrthonormal) {
  const SurfaceOperators operators = operators_of(zoo::perturbed_sphere(4, 3));
  const Eigenbasis basis = basis_of(operators, 256);
  EXPECT_LT(orthonormality_error(basis), 1e-11);
  EXPECT_LT(recomputed_residual(operators.laplacian, basis), 1e-8);
}

TEST(Eigenbasis, SameBytesEveryTime) {
  const SurfaceOperators operators = operators_of(zoo::perturbed_sphere(3, 1));
  const Eigenbasis a = basis_of(operators, 30), b = basis_of(operators, 30);
  EXPECT_EQ(a.values, b.values);
  EXPECT_EQ(a.functions, b.functions);
}

TEST(Eigenbasis, DoesNotDependOnHowTheMeshIsTurned) {
  const zoo::Mesh mesh = zoo::perturbed_sphere(2, 7);
  const Points turned = mesh.vertices * test::rotation(1);
  const Eigenbasis a = basis_of(operators_of(mesh), 24);
  const Eigenbasis b = basis_of(operators_of({turned, mesh.faces}), 24);
  const RowMatrix<double> field = test::noise(mesh.vertices.rows(), 3, 1);
  const Eigen::Index count = a.stable_count(20);
  EXPECT_LT((a.project(field, count) - b.project(field, count)).norm(), 1e-8 * field.norm());
}

Eigenbasis with_values(std::initializer_list<double> values) {
  Eigenbasis basis;
  basis.values = Eigen::VectorXd::Map(values.begin(), static_cast<Eigen::Index>(values.size()));
  return basis;
}

TEST(StableCount, DoesNotCutThroughAMultipleEigenvalue) {
  const Eigenbasis basis = with_values({0.0, 2.0, 2.0 + 1e-9, 2.0 + 2e-9, 6.0, 6.0, 7.0});
  EXPECT_EQ(basis.stable_count(1), 1);
  EXPECT_EQ(basis.stable_count(2), 1);
  EXPECT_EQ(basis.stable_count(3), 1);
  EXPECT_EQ(basis.stable_count(4), 4);
  EXPECT_EQ(basis.stable_count(5), 4);
  EXPECT_EQ(basis.stable_count(6), 6);
  EXPECT_EQ(basis.stable_count(7), 7);
  EXPECT_EQ(basis.stable_count(100), 7);
}

TEST(StableCount, ZerosOfSeveralComponentsAreOneEigenvalue) {
  // What a solver returns for three components: rounding, no true differences.
  const Eigenbasis basis = with_values({0.0, 1e-14, 3e-13, 5.0, 8.0});
  EXPECT_EQ(basis.stable_count(3), 3);
  EXPECT_EQ(basis.stable_count(4), 4);
}

TEST(StableCount, OfTheSphereEndsWholeMultiplets) {
  const Eigenbasis basis = basis_of(operators_of(zoo::icosphere(3)), 40);
  EXPECT_EQ(basis.stable_count(4), 4);
  EXPECT_EQ(basis.stable_count(8), 4);
  EXPECT_EQ(basis.stable_count(9), 9);
  // The icosahedron splits the seven functions of l = 3 in three and four.
  EXPECT_EQ(basis.stable_count(10), 9);
}

TEST(EigenbasisErrors, NoFunctionsAskedFor) {
  const SurfaceOperators operators = operators_of(zoo::cube());
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"0"}, [&] { basis_of(operators, 0); }));
}

TEST(EigenbasisErrors, TooFewIterationsAreReported) {
  const SurfaceOperators operators = operators_of(zoo::perturbed_sphere(3, 7));
  EXPECT_TRUE(test::fails_with(ErrorCode::no_convergence, {"residual"}, [&] {
    eigenbasis(operators.laplacian, operators.mass,
               {.count = 100, .method = EigenMethod::lanczos, .max_restarts = 0});
  }));
}

TEST(EigenbasisCancel, FromTheStart) {
  for (const int levels : {1, 3}) {  // dense and Lanczos
    const SurfaceOperators operators = operators_of(zoo::icosphere(levels));
    Progress progress;
    progress.cancel();
    EXPECT_TRUE(test::fails_with(ErrorCode::cancelled, {},
                                 [&] { basis_of(operators, 20, ProgressRange(&progress)); }));
  }
}

TEST(EigenbasisCancel, FromAnotherThreadWhileItWorks) {
  const SurfaceOperators operators = operators_of(zoo::icosphere(3));
  Progress progress;
  std::thread watcher([&] {
    while (progress.fraction() == 0.0) {
      std::this_thread::yield();
    }
    progress.cancel();
  });
  // Repeated, so that the test does not depend on who is faster; it ends only by the cancellation.
  EXPECT_TRUE(test::fails_with(ErrorCode::cancelled, {}, [&] {
    for (;;) {
      basis_of(operators, 40, ProgressRange(&progress));
    }
  }));
  watcher.join();
}

TEST(EigenbasisProgress, EndsAtOne) {
  const SurfaceOperators operators = operators_of(zoo::icosphere(2));
  Progress progress;
  basis_of(operators, 20, ProgressRange(&progress));
  EXPECT_DOUBLE_EQ(progress.fraction(), 1.0);
}

}  // namespace
}  // namespace supple
