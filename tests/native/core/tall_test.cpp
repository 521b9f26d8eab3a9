// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/core/tall.h"

#include <limits>
#include <vector>

#include "native/support.h"

namespace supple {
namespace {

template <class Scalar>
class Tall : public ::testing::Test {};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(Tall, Scalars);
template <class Scalar>
class TallDeathTest : public ::testing::Test {};
TYPED_TEST_SUITE(TallDeathTest, Scalars);

// Numbers -4..3: every sum of products below is exact in either type, in whatever order, so that
// a result is right or wrong.
template <class Scalar>
RowMatrix<Scalar> integers(Eigen::Index rows, Eigen::Index cols, uint64_t seed) {
  return (4.0 * test::noise(rows, cols, seed)).array().floor().matrix().template cast<Scalar>();
}

// Some columns of a wider matrix, with NaN on either side: whoever reads those shows it.
template <class Scalar>
class Embedded {
 public:
  Embedded(const RowMatrix<Scalar>& inner, Eigen::Index left, Eigen::Index right)
      : left_(left), columns_(inner.cols()) {
    wide_.setConstant(inner.rows(), left + inner.cols() + right,
                      std::numeric_limits<Scalar>::quiet_NaN());
    wide_.middleCols(left, inner.cols()) = inner;
  }
  auto columns() { return wide_.middleCols(left_, columns_); }
  auto columns() const { return wide_.middleCols(left_, columns_); }
  bool outside_untouched() const {
    return wide_.leftCols(left_).array().isNaN().all() &&
           wide_.rightCols(wide_.cols() - left_ - columns_).array().isNaN().all();
  }

 private:
  RowMatrix<Scalar> wide_;
  Eigen::Index left_, columns_;
};

// Widths of the pieces of A: one alone, several that differ, an empty one, as many as a basis has.
const std::vector<std::vector<Eigen::Index>> kPieces = {
    {}, {1}, {3}, {8}, {5, 0, 16, 1}, {8, 8, 8, 8, 8}, {130}};

template <class Scalar>
struct Case {
  Case(Eigen::Index rows, const std::vector<Eigen::Index>& widths, Eigen::Index columns)
      : b(integers<Scalar>(rows, columns, 99), 2, 3) {
    Eigen::Index total = 0;
    for (size_t i = 0; i < widths.size(); ++i) {
      total += widths[i];
      stored.emplace_back(integers<Scalar>(rows, widths[i], i + 1), static_cast<Eigen::Index>(i),
                          static_cast<Eigen::Index>(i % 2));
    }
    whole.resize(rows, total);
    for (Eigen::Index i = 0, first = 0; i < static_cast<Eigen::Index>(widths.size()); ++i) {
      const auto& piece = std::as_const(stored[static_cast<size_t>(i)]);
      whole.middleCols(first, piece.columns().cols()) = piece.columns();
      first += piece.columns().cols();
      a.push_back(piece.columns());
    }
    c = integers<Scalar>(total, columns, 98);
  }
  std::vector<Embedded<Scalar>> stored;
  Embedded<Scalar> b;
  TallPieces<Scalar> a;  // into `stored`
  RowMatrix<Scalar> whole, c;
};

template <class Scalar>
void expect_products(Eigen::Index rows, const std::vector<Eigen::Index>& widths,
                     Eigen::Index columns) {
  Case<Scalar> it(rows, widths, columns);
  const auto where = [&] {
    return ::testing::Message() << rows << " rows, " << widths.size() << " pieces of "
                                << it.whole.cols() << " columns, times " << columns;
  };
  const RowMatrix<Scalar> before = it.b.columns();
  const RowMatrix<Scalar> transposed = tall_product<Scalar>(it.a, it.b.columns());
  ASSERT_EQ(transposed.rows(), it.whole.cols()) << where();
  ASSERT_EQ(transposed.cols(), columns) << where();
  EXPECT_EQ(transposed, it.whole.transpose().lazyProduct(before)) << where();

  add_tall_product<Scalar>(Scalar(-2), it.a, it.c, it.b.columns());
  const RowMatrix<Scalar> expected = before - Scalar(2) * it.whole.lazyProduct(it.c);
  EXPECT_EQ(RowMatrix<Scalar>(it.b.columns()), expected) << where();
  EXPECT_TRUE(it.b.outside_untouched()) << where();
}

template <class Scalar>
void expect_all_products() {
  for (const auto& widths : kPieces) {
    for (Eigen::Index columns = 0; columns <= 40; ++columns) {
      expect_products<Scalar>(130, widths, columns);  // a tile and two rows
    }
    for (const Eigen::Index rows : {0, 1, 7, 16, 17, 127, 128, 129, 511, 512, 1000, 3000}) {
      for (const Eigen::Index columns : {1, 3, 8, 16, 33}) {
        expect_products<Scalar>(rows, widths, columns);
      }
    }
  }
}

TYPED_TEST(Tall, ProductsAreExactOnIntegers) {
  for (const int threads : {1, 2, 4}) {
    const test::Threads scope(threads);
    expect_all_products<TypeParam>();
  }
}

TYPED_TEST(TallDeathTest, EveryInstructionSetIsExactOnIntegers) {
  test::at_every_simd_level([] { expect_all_products<TypeParam>(); });
}

// |A^T B - exact| <= n eps |A|^T |B| for any order of summation.
TYPED_TEST(Tall, ProductsAreRightToRounding) {
  using Scalar = TypeParam;
  const Eigen::Index n = 2000;
  const RowMatrix<Scalar> a = test::noise(n, 40, 1).cast<Scalar>(),
                          b = test::noise(n, 24, 2).cast<Scalar>(),
                          c = test::noise(40, 24, 3).cast<Scalar>();
  const RowMatrix<double> ad = a.template cast<double>(), bd = b.template cast<double>(),
                          cd = c.template cast<double>();
  const double eps = std::numeric_limits<Scalar>::epsilon();
  const RowMatrix<double> got = tall_product<Scalar>({a}, b).template cast<double>();
  const RowMatrix<double> bound = ad.cwiseAbs().transpose() * bd.cwiseAbs();
  EXPECT_TRUE(((got - ad.transpose() * bd).array().abs() <= n * eps * bound.array()).all());

  RowMatrix<Scalar> sum = b;
  add_tall_product<Scalar>(Scalar(0.3), {a}, c, sum);
  const double alpha = Scalar(0.3);
  const RowMatrix<double> size = bd.cwiseAbs() + alpha * (ad.cwiseAbs() * cd.cwiseAbs());
  EXPECT_TRUE(((sum.template cast<double>() - bd - alpha * (ad * cd)).array().abs() <=
               43 * eps * size.array())
                  .all());
}

TYPED_TEST(Tall, SameBytesForAnyNumberOfThreads) {
  using Scalar = TypeParam;
  const RowMatrix<Scalar> a = test::noise(3000, 30, 1).cast<Scalar>(),
                          b = test::noise(3000, 11, 2).cast<Scalar>(),
                          c = test::noise(30, 11, 3).cast<Scalar>();
  const TallPieces<Scalar> pieces = {a.leftCols(8), a.middleCols(8, 8), a.rightCols(14)};
  const auto both = [&](int threads) {
    const test::Threads scope(threads);
    RowMatrix<Scalar> sum = b;
    add_tall_product<Scalar>(Scalar(1.7), pieces, c, sum);
    return std::pair(tall_product<Scalar>(pieces, b), sum);
  };
  const auto one = both(1);
  for (const int threads : {2, 3, 4, 20}) {
    EXPECT_EQ(both(threads), one) << threads << " threads";
  }
}

TYPED_TEST(Tall, WrongShapes) {
  using Scalar = TypeParam;
  const RowMatrix<Scalar> a = integers<Scalar>(10, 4, 1), b = integers<Scalar>(10, 3, 2),
                          short_one = integers<Scalar>(9, 4, 3);
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"tall_product"}, [&] {
    tall_product<Scalar>({a, short_one}, b);
  }));
  RowMatrix<Scalar> sum = b;
  const auto add = [&](const TallPieces<Scalar>& pieces, Eigen::Index rows, Eigen::Index cols) {
    add_tall_product<Scalar>(Scalar(1), pieces, RowMatrix<Scalar>::Ones(rows, cols), sum);
  };
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"add_tall_product"},
                               [&] { add({short_one}, 4, 3); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {}, [&] { add({a}, 5, 3); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {}, [&] { add({a}, 4, 2); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {}, [&] { add({a}, 4, 4); }));
  EXPECT_EQ(sum, b) << "a refused call changed its result";
}

}  // namespace
}  // namespace supple
