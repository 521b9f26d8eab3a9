// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/core/dense.h"

#include <gtest/gtest.h>

#include <Eigen/QR>
#include <cmath>
#include <limits>

#include "native/support.h"

namespace supple {
namespace {

using test::noise;

TEST(Gemm, AgreesWithEigenForEveryTransposition) {
  const RowMatrix<double> a = noise(7, 5, 1), b = noise(5, 4, 2);
  const RowMatrix<double> at = a.transpose(), bt = b.transpose(), expected = a.lazyProduct(b);
  EXPECT_TRUE(product(a, b).isApprox(expected, 1e-13));
  EXPECT_TRUE(product(at, Op::transpose, b, Op::none).isApprox(expected, 1e-13));
  EXPECT_TRUE(product(a, Op::none, bt, Op::transpose).isApprox(expected, 1e-13));
  EXPECT_TRUE(product(at, Op::transpose, bt, Op::transpose).isApprox(expected, 1e-13));
}

TEST(Gemm, ScalesAndAccumulates) {
  const RowMatrix<float> a = noise(3, 6, 1).cast<float>(), b = noise(6, 2, 2).cast<float>();
  const RowMatrix<float> start = noise(3, 2, 3).cast<float>();
  RowMatrix<float> c = start;
  gemm(2.0F, a, Op::none, b, Op::none, 0.5F, c);
  EXPECT_TRUE(c.isApprox(2.0F * a.lazyProduct(b) + 0.5F * start, 1e-5F));
}

TEST(Gemm, EmptySizes) {
  const RowMatrix<double> a(3, 0), b(0, 2), none(0, 3);
  EXPECT_TRUE(product(a, b).isZero(0.0));
  EXPECT_EQ(product(none, noise(3, 2, 1)).rows(), 0);
  RowMatrix<double> c = RowMatrix<double>::Ones(3, 2);
  gemm(1.0, a, Op::none, b, Op::none, 0.25, c);
  EXPECT_TRUE(c.isApproxToConstant(0.25, 0.0));
}

TEST(Gemm, WrongShape) {
  const RowMatrix<double> a = noise(3, 4, 1), b = noise(5, 2, 2);
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"3x4", "5x2"}, [&] { product(a, b); }));
  RowMatrix<double> c(2, 2);
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {}, [&] {
    gemm(1.0, a, Op::none, RowMatrix<double>(noise(4, 2, 3)), Op::none, 1.0, c);
  }));
}

// Q diag(values) Q^T of a random orthogonal Q.
Eigen::MatrixXd with_eigenvalues(const Eigen::VectorXd& values, uint64_t seed) {
  const Eigen::Index n = values.size();
  const Eigen::MatrixXd random = noise(n, n, seed);
  const Eigen::MatrixXd q = Eigen::HouseholderQR<Eigen::MatrixXd>(random).householderQ();
  const Eigen::MatrixXd result = q * values.asDiagonal() * q.transpose();
  return 0.5 * (result + result.transpose());
}

// Everything that makes (values, vectors) the decomposition of a matrix.
void expect_eigen(const Eigen::MatrixXd& matrix) {
  const Eigen::Index n = matrix.rows();
  Eigen::MatrixXd vectors = matrix;
  const Eigen::VectorXd values = symmetric_eigen(vectors);
  ASSERT_EQ(values.size(), n);
  const double rounding = 10.0 * static_cast<double>(n) * std::numeric_limits<double>::epsilon();
  EXPECT_LE((matrix * vectors - vectors * values.asDiagonal()).norm(), rounding * matrix.norm());
  EXPECT_LE((vectors.transpose() * vectors - Eigen::MatrixXd::Identity(n, n)).norm(), rounding);
  for (Eigen::Index i = 1; i < n; ++i) {
    EXPECT_LE(values[i - 1], values[i]) << "values " << i - 1 << " and " << i << " of " << n;
  }
}

TEST(SymmetricEigen, DecomposesEverySize) {
  // Divide and conquer begins above 25.
  for (const Eigen::Index n : {1, 2, 3, 8, 24, 25, 26, 27, 60, 129}) {
    const Eigen::MatrixXd random = noise(n, n, static_cast<uint64_t>(n));
    expect_eigen(random + random.transpose());
  }
}

TEST(SymmetricEigen, FindsKnownValues) {
  Eigen::VectorXd values = Eigen::VectorXd::LinSpaced(70, -3.0, 9.0).array().cube();
  Eigen::MatrixXd matrix = with_eigenvalues(values, 1);
  EXPECT_LT((symmetric_eigen(matrix) - values).cwiseAbs().maxCoeff(), 1e-12 * 729.0);
}

TEST(SymmetricEigen, MultipleValues) {
  Eigen::VectorXd values = Eigen::VectorXd::Constant(50, 2.0);
  values.head(20).setConstant(-1.0);
  values.tail(3).setZero();
  expect_eigen(with_eigenvalues(values, 1));
  expect_eigen(Eigen::MatrixXd::Identity(40, 40));
  expect_eigen(Eigen::MatrixXd::Zero(40, 40));
  expect_eigen(Eigen::MatrixXd::Ones(40, 40));
}

TEST(SymmetricEigen, SizesOfNumbersFarApart) {
  const Eigen::VectorXd exponent = Eigen::VectorXd::LinSpaced(40, -30.0, 30.0);
  expect_eigen(with_eigenvalues(exponent.unaryExpr([](double e) { return std::pow(10.0, e); }), 2));
}

TEST(SymmetricEigen, Empty) {
  Eigen::MatrixXd none(0, 0);
  EXPECT_EQ(symmetric_eigen(none).size(), 0);
}

TEST(SymmetricEigen, NumbersThatAreNotFiniteAreAnError) {
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    for (const Eigen::Index n : {1, 2, 5, 25, 26, 60, 200}) {
      for (const Eigen::Index row : {Eigen::Index(0), n / 2, n - 1}) {
        Eigen::MatrixXd matrix = noise(n, n, 1);
        matrix = (matrix + matrix.transpose()).eval();
        matrix(row, 0) = matrix(0, row) = bad;
        EXPECT_TRUE(test::fails_with(ErrorCode::no_convergence, {"not finite"},
                                     [&] { symmetric_eigen(matrix); }))
            << bad << " in row " << row << " of " << n;
      }
    }
  }
}

}  // namespace
}  // namespace supple
