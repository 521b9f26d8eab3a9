// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/core/sparse_product.h"

#include "native/support.h"
#include "supple/core/parallel.h"

namespace supple {
namespace {

// Entries -4..3, most of them 0: sums of their products are exact in any order.
SparseRowMatrix integers(Eigen::Index rows, Eigen::Index cols, uint64_t seed) {
  const RowMatrix<double> all = (4.0 * test::noise(rows, cols, seed)).array().floor();
  const RowMatrix<double> keep = test::noise(rows, cols, seed + 100);
  return RowMatrix<double>((keep.array() > 0.8).select(all, 0.0)).sparseView();
}

TEST(SparseProduct, IsThatOfTheDenseMatrices) {
  for (const Eigen::Index rows : {0, 1, 7, 4095, 4096, 4097, 9000}) {
    const SparseRowMatrix a = integers(rows, 60, 1), b = integers(60, 45, 2);
    const SparseRowMatrix product = sparse_product(a, b);
    ASSERT_EQ(product.rows(), rows);
    ASSERT_EQ(product.cols(), 45);
    EXPECT_EQ(RowMatrix<double>(product), RowMatrix<double>(a) * RowMatrix<double>(b)) << rows;
    for (Eigen::Index i = 0; i < rows; ++i) {
      Eigen::Index before = -1;
      for (SparseRowMatrix::InnerIterator it(product, i); it; ++it) {
        ASSERT_LT(before, it.col()) << "row " << i << " is not in ascending order";
        before = it.col();
      }
    }
  }
}

TEST(SparseProduct, HasTheSameBytesForAnyNumberOfThreads) {
  const SparseRowMatrix a = RowMatrix<double>(test::noise(9000, 12, 3)).sparseView();
  const SparseRowMatrix b = RowMatrix<double>(test::noise(12, 12, 4)).sparseView();
  const SparseRowMatrix shared = sparse_product(a, b);
  const SingleThread alone;
  EXPECT_EQ(RowMatrix<double>(shared), RowMatrix<double>(sparse_product(a, b)));
}

TEST(Thinned, KeepsLargeEntriesAndSumsToOne) {
  RowMatrix<double> dense(4, 3);
  dense << 2.0, -0.1, 1.0,  //
      0.0, 0.0, 0.0,        //
      1.0, -1.0, 0.0,       //
      0.2, 4.0, 0.4;
  RowMatrix<double> expected(4, 3);
  expected << 2.0 / 3.0, 0.0, 1.0 / 3.0,  //
      0.0, 0.0, 0.0,                      //
      1.0, -1.0, 0.0,                     //
      0.0, 1.0 / 1.1, 0.1 / 1.1;
  const SparseRowMatrix thin = thinned(dense.sparseView(), 0.1);
  EXPECT_LT((RowMatrix<double>(thin) - expected).cwiseAbs().maxCoeff(), 1e-15);
  EXPECT_EQ(thin.nonZeros(), 6);
}

}  // namespace
}  // namespace supple
