// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/core/dense.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace supple
