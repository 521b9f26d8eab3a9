// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/sparse_cholesky.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "native/support.h"
#include "supple/geometry/surface_operators.h"

namespace supple {
namespace {

using Backend = CholeskyBackend;

// W + M of a mesh: definite, with the pattern every solve of the library has.
SparseMatrix definite(const zoo::Mesh& mesh) {
  const SurfaceOperators operators{TriangleMesh(mesh.vertices, mesh.faces)};
  SparseMatrix matrix = operators.laplacian;
  matrix.diagonal() += operators.mass;
  return matrix;
}

SparseMatrix sparse(const Eigen::MatrixXd& dense) { return dense.sparseView(); }

class Cholesky : public ::testing::TestWithParam<Backend> {
 protected:
  void SetUp() override {
    if (!SparseCholesky::available(GetParam())) {
      GTEST_SKIP() << "this build has no CHOLMOD";
    }
  }
};

TEST_P(Cholesky, Solves) {
  for (const zoo::Entry& entry : zoo::all()) {
    const SparseMatrix matrix = definite(entry.mesh);
    const SparseCholesky factor(matrix, GetParam());
    EXPECT_EQ(factor.size(), matrix.rows());
    EXPECT_EQ(factor.backend(), GetParam());
    const Eigen::MatrixXd rhs = test::noise(matrix.rows(), 4, 1);
    const Eigen::MatrixXd x = factor.solve(rhs);
    ASSERT_EQ(x.cols(), 4);
    // Backward stable: the residual is rounding of |A| |x|.
    const double size = Eigen::MatrixXd(matrix).norm() * x.norm();
    EXPECT_LT((matrix * x - rhs).norm(), 1e-13 * size) << entry.name;
  }
}

TEST_P(Cholesky, SolvesAHandMadeSystem) {
  const SparseMatrix matrix = sparse((Eigen::Matrix2d() << 4, 2, 2, 3).finished());
  const Eigen::MatrixXd x = SparseCholesky(matrix, GetParam()).solve(Eigen::Vector2d(8, 8));
  EXPECT_NEAR(x(0), 1.0, 1e-15);
  EXPECT_NEAR(x(1), 2.0, 1e-15);
}

TEST_P(Cholesky, NotPositiveDefinite) {
  const Eigen::Matrix2d indefinite = (Eigen::Matrix2d() << 1, 2, 2, 1).finished();
  EXPECT_TRUE(test::fails_with(ErrorCode::not_positive_definite, {"2 x 2"},
                               [&] { SparseCholesky(sparse(indefinite), GetParam()); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::not_positive_definite, {}, [&] {
    SparseCholesky(sparse(-Eigen::Matrix3d::Identity()), GetParam());
  }));
  EXPECT_TRUE(test::fails_with(ErrorCode::not_positive_definite, {},
                               [&] { SparseCholesky(SparseMatrix(3, 3), GetParam()); }));
}

TEST_P(Cholesky, WrongShape) {
  const SparseCholesky factor(sparse(Eigen::Matrix3d::Identity()), GetParam());
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"3", "4"},
                               [&] { factor.solve(Eigen::MatrixXd::Zero(4, 1)); }));
}

TEST_P(Cholesky, NotSquare) {
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {},
                               [&] { SparseCholesky(SparseMatrix(3, 2), GetParam()); }));
}

TEST_P(Cholesky, Empty) {
  const SparseCholesky factor(SparseMatrix(0, 0), GetParam());
  EXPECT_EQ(factor.size(), 0);
  const Eigen::MatrixXd x = factor.solve(Eigen::MatrixXd(0, 3));
  EXPECT_EQ(x.rows(), 0);
  EXPECT_EQ(x.cols(), 3);
}

TEST_P(Cholesky, NoRightHandSides) {
  const SparseCholesky factor(sparse(Eigen::Matrix3d::Identity()), GetParam());
  const Eigen::MatrixXd x = factor.solve(Eigen::MatrixXd(3, 0));
  EXPECT_EQ(x.rows(), 3);
  EXPECT_EQ(x.cols(), 0);
}

TEST_P(Cholesky, MovesKeepTheFactor) {
  SparseCholesky first(sparse(2.0 * Eigen::Matrix3d::Identity()), GetParam());
  SparseCholesky second = std::move(first);
  first = SparseCholesky(sparse(Eigen::Matrix2d::Identity()), GetParam());
  EXPECT_NEAR(second.solve(Eigen::Vector3d::Ones())(0), 0.5, 1e-15);
  EXPECT_EQ(first.size(), 2);
}

TEST_P(Cholesky, SeveralThreadsSolveTheSame) {
  const SparseMatrix matrix = definite(zoo::icosphere(2));
  const SparseCholesky factor(matrix, GetParam());
  const Eigen::MatrixXd rhs = test::noise(matrix.rows(), 3, 1);
  const Eigen::MatrixXd expected = factor.solve(rhs);
  std::vector<Eigen::MatrixXd> results(4);
  std::vector<std::thread> threads;
  for (auto& result : results) {
    threads.emplace_back([&factor, &rhs, &result] {
      for (int i = 0; i < 20; ++i) {
        result = factor.solve(rhs);
      }
    });
  }
  for (auto& thread : threads) {
    thread.join();
  }
  for (const auto& result : results) {
    EXPECT_EQ(result, expected);
  }
}

TEST_P(Cholesky, BackwardOfForwardSolves) {
  for (const zoo::Entry& entry : zoo::all()) {
    const SparseMatrix matrix = definite(entry.mesh);
    const SparseCholesky factor(matrix, GetParam());
    for (const Eigen::Index columns : {1, 3, 17}) {
      const RowMatrix<double> rhs = test::noise(matrix.rows(), columns, 4);
      const RowMatrix<double> expected = factor.solve(rhs);
      EXPECT_LT((factor.backward(factor.forward(rhs)) - expected).norm(), 1e-13 * expected.norm())
          << entry.name << ", " << columns << " columns";
    }
  }
}

TEST_P(Cholesky, ForwardOfUnitVectorsHasTheInversesInnerProducts) {
  // With A = P^T L L^T P the columns L^-1 P e_i have the inner products of A^-1.
  for (const zoo::Entry& entry : zoo::all()) {
    const SparseMatrix matrix = definite(entry.mesh);
    const SparseCholesky factor(matrix, GetParam());
    const Eigen::Index n = matrix.rows(), count = std::min<Eigen::Index>(n, 12);
    RowMatrix<double> units = RowMatrix<double>::Zero(n, count);
    for (Eigen::Index i = 0; i < count; ++i) {
      units(i * n / count, i) = 1.0;
    }
    const RowMatrix<double> half = factor.forward(units);
    const RowMatrix<double> expected = units.transpose() * factor.solve(units);
    EXPECT_LT((half.transpose() * half - expected).norm(), 1e-12 * expected.norm()) << entry.name;
  }
}

TEST_P(Cholesky, HalvesAreInTheFactorsOrder) {
  // Of a diagonal matrix a half is the root of its entry, moved to the row's place in the factor.
  const Eigen::VectorXd diagonal = Eigen::VectorXd::LinSpaced(9, 1.0, 9.0);
  Eigen::MatrixXd dense = diagonal.asDiagonal();
  const SparseCholesky factor(sparse(dense), GetParam());
  const Eigen::VectorXi& order = factor.symbolic().ordering();
  const RowMatrix<double> half = factor.forward(RowMatrix<double>::Identity(9, 9));
  for (int place = 0; place < 9; ++place) {
    EXPECT_NEAR(half(place, order[place]), 1.0 / std::sqrt(diagonal[order[place]]), 1e-15);
  }
  EXPECT_NEAR(half.squaredNorm(), diagonal.cwiseInverse().sum(), 1e-13);
}

INSTANTIATE_TEST_SUITE_P(Backends, Cholesky, ::testing::Values(Backend::cholmod, Backend::eigen),
                         [](const auto& info) {
                           return info.param == Backend::cholmod ? "cholmod" : "eigen";
                         });

TEST(CholeskyBackends, GiveTheSameSolution) {
  if (!SparseCholesky::available(Backend::cholmod)) {
    GTEST_SKIP() << "this build has no CHOLMOD";
  }
  const SparseMatrix matrix = definite(zoo::perturbed_sphere(3, 1));
  const Eigen::MatrixXd rhs = test::noise(matrix.rows(), 3, 1);
  const Eigen::MatrixXd a = SparseCholesky(matrix, Backend::cholmod).solve(rhs);
  const Eigen::MatrixXd b = SparseCholesky(matrix, Backend::eigen).solve(rhs);
  EXPECT_LT((a - b).norm(), 1e-11 * a.norm());
}

TEST(CholeskyOrderings, AllSolveAndEachFactorNamesItsOwn) {
  const SparseMatrix matrix = definite(zoo::perturbed_sphere(3, 1));
  const RowMatrix<double> rhs = test::noise(matrix.rows(), 3, 1);
  const RowMatrix<double> expected = SparseCholesky(matrix).solve(rhs);
  for (const Backend backend : {Backend::cholmod, Backend::eigen}) {
    for (const char* name : {"automatic", "amd", "metis"}) {
      const bool metis = name == std::string("metis");
      if (!SparseCholesky::available(backend) || (backend == Backend::eigen && metis)) {
        continue;
      }
      const auto symbolic =
          std::make_shared<const SymbolicCholesky>(matrix, backend, cholesky_ordering(name));
      const SparseCholesky factor(matrix, symbolic);
      EXPECT_LT((factor.solve(rhs) - expected).norm(), 1e-11 * expected.norm()) << name;
      EXPECT_EQ(&factor.symbolic(), symbolic.get());
      // The ordering, given back, gives the same factor.
      const SparseCholesky again(
          matrix, std::make_shared<const SymbolicCholesky>(matrix, backend, symbolic->ordering()));
      EXPECT_EQ(again.factor_entries(), factor.factor_entries()) << name;
    }
  }
}

TEST(CholeskyOrderings, ThoseThatAreNotThereAreNamed) {
  const SparseMatrix matrix = sparse(Eigen::Matrix2d::Identity());
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"METIS", "'amd'"}, [&] {
    SymbolicCholesky(matrix, Backend::eigen, CholeskyOrdering::metis);
  }));
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"'best'", "'metis'"},
                               [] { cholesky_ordering("best"); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"'lapack'", "'eigen'"},
                               [] { cholesky_backend("lapack"); }));
  EXPECT_EQ(cholesky_backend("cholmod"), Backend::cholmod);
}

TEST(CholeskySymmetry, IsChecked) {
  EXPECT_NO_THROW(check_symmetric(definite(zoo::torus(12, 8))));
  const Eigen::Matrix2d skew = (Eigen::Matrix2d() << 4, 2, 2.1, 3).finished();
  EXPECT_TRUE(test::fails_with(ErrorCode::not_positive_definite, {"not symmetric", "(1, 0)"},
                               [&] { check_symmetric(sparse(skew)); }));
  const Eigen::Matrix2d half = (Eigen::Matrix2d() << 4, 2, 0, 3).finished();
  EXPECT_TRUE(test::fails_with(ErrorCode::not_positive_definite, {"both triangles"},
                               [&] { check_symmetric(sparse(half)); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"2 x 3"},
                               [] { check_symmetric(SparseMatrix(2, 3)); }));
}

TEST(CholeskyBackends, EigenIsAlwaysThereAndTheDefaultIsAvailable) {
  EXPECT_TRUE(SparseCholesky::available(Backend::eigen));
  EXPECT_TRUE(SparseCholesky::available(SparseCholesky::default_backend()));
}

TEST(CholeskyBackends, AMissingOneIsNamed) {
  if (SparseCholesky::available(Backend::cholmod)) {
    GTEST_SKIP() << "this build has CHOLMOD";
  }
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"CHOLMOD"}, [] {
    SparseCholesky(sparse(Eigen::Matrix2d::Identity()), Backend::cholmod);
  }));
}

}  // namespace
}  // namespace supple
