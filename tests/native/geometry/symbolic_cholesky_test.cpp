// SPDX-License-Identifier: GPL-3.0-or-later
// Analyses shared by several factorisations, and solves with many right-hand sides.
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <thread>
#include <vector>

#include "geometry/supernodal_solve.h"
#include "native/support.h"
#include "supple/core/parallel.h"
#include "supple/geometry/sparse_cholesky.h"
#include "supple/geometry/surface_operators.h"

namespace supple {
namespace {

using Backend = CholeskyBackend;

// W + shift * M of a mesh.
SparseMatrix definite(const zoo::Mesh& mesh, double shift = 1.0) {
  const SurfaceOperators operators{TriangleMesh(mesh.vertices, mesh.faces)};
  SparseMatrix matrix = operators.laplacian;
  matrix.diagonal() += shift * operators.mass;
  return matrix;
}

// Backward stable: the residual is rounding of |A| |x|.
void expect_solves(const SparseCholesky& factor, const SparseMatrix& matrix,
                   const RowMatrix<double>& rhs) {
  const RowMatrix<double> x = factor.solve(rhs);
  ASSERT_EQ(x.rows(), rhs.rows());
  ASSERT_EQ(x.cols(), rhs.cols());
  for (Eigen::Index c = 0; c < rhs.cols(); ++c) {
    EXPECT_LT((matrix * x.col(c) - rhs.col(c)).norm(), 1e-13 * matrix.norm() * x.col(c).norm())
        << "column " << c << " of " << rhs.cols();
  }
}

bool is_permutation(Eigen::VectorXi order) {
  std::sort(order.begin(), order.end());
  return order == Eigen::VectorXi::LinSpaced(order.size(), 0, static_cast<int>(order.size()) - 1);
}

Eigen::VectorXi shuffled(Eigen::Index n) {
  Eigen::VectorXi order(n);
  std::iota(order.begin(), order.end(), 0);
  std::mt19937 random(3);
  for (Eigen::Index i = n - 1; i > 0; --i) {
    std::swap(order[i], order[static_cast<Eigen::Index>(random() % static_cast<unsigned>(i + 1))]);
  }
  return order;
}

class SymbolicCholeskyBackends : public ::testing::TestWithParam<Backend> {
 protected:
  void SetUp() override {
    if (!SparseCholesky::available(GetParam())) {
      GTEST_SKIP() << "this build has no CHOLMOD";
    }
  }
  std::shared_ptr<const SymbolicCholesky> analysis(const SparseMatrix& pattern,
                                                   const Eigen::VectorXi& ordering = {}) const {
    return std::make_shared<const SymbolicCholesky>(pattern, GetParam(), ordering);
  }
};

TEST_P(SymbolicCholeskyBackends, OneAnalysisServesEveryMatrixOfThePattern) {
  for (const zoo::Entry& entry : zoo::all()) {
    SCOPED_TRACE(entry.name);
    const SparseMatrix first = definite(entry.mesh), second = definite(entry.mesh, 1000.0);
    const auto shared = analysis(first);
    EXPECT_EQ(shared->size(), first.rows());
    EXPECT_EQ(shared->backend(), GetParam());
    const RowMatrix<double> rhs = test::noise(first.rows(), 5, 1);
    // Both alive at once: neither may keep its numbers in what they share.
    const SparseCholesky a(first, shared), b(second, shared);
    expect_solves(a, first, rhs);
    expect_solves(b, second, rhs);
    EXPECT_EQ(a.solve(rhs), SparseCholesky(first, GetParam()).solve(rhs));
    EXPECT_EQ(b.solve(rhs), SparseCholesky(second, shared).solve(rhs));
    EXPECT_EQ(a.factor_entries(), b.factor_entries());
    EXPECT_GE(a.factor_entries(), (first.nonZeros() + first.rows()) / 2) << "less than the matrix";
  }
}

TEST_P(SymbolicCholeskyBackends, ValuesOfThePatternAreNotRead) {
  const SparseMatrix matrix = definite(zoo::perturbed_sphere(2, 1));
  SparseMatrix pattern = matrix;
  pattern.coeffs().setZero();
  const RowMatrix<double> rhs = test::noise(matrix.rows(), 2, 1);
  EXPECT_EQ(SparseCholesky(matrix, analysis(pattern)).solve(rhs),
            SparseCholesky(matrix, analysis(matrix)).solve(rhs));
}

TEST_P(SymbolicCholeskyBackends, OrderingNamesEachRowOnceAndFillsLittle) {
  const SparseMatrix matrix = definite(zoo::icosphere(3));
  const auto found = analysis(matrix);
  EXPECT_TRUE(is_permutation(found->ordering()));
  const auto bad = analysis(matrix, shuffled(matrix.rows()));
  EXPECT_LT(2 * SparseCholesky(matrix, found).factor_entries(),
            SparseCholesky(matrix, bad).factor_entries());
}

TEST_P(SymbolicCholeskyBackends, TakesAGivenOrdering) {
  const SparseMatrix matrix = definite(zoo::perturbed_sphere(2, 1));
  const RowMatrix<double> rhs = test::noise(matrix.rows(), 3, 1);
  const Eigen::VectorXi straight =
      Eigen::VectorXi::LinSpaced(matrix.rows(), 0, static_cast<int>(matrix.rows()) - 1);
  for (const Eigen::VectorXi& order :
       {straight, Eigen::VectorXi(straight.reverse()), shuffled(matrix.rows())}) {
    const auto given = analysis(matrix, order);
    EXPECT_TRUE(is_permutation(given->ordering()));
    expect_solves(SparseCholesky(matrix, given), matrix, rhs);
  }
}

TEST_P(SymbolicCholeskyBackends, AKnownOrderingGivesTheSameFactor) {
  // What a cache keeps of an analysis is the ordering alone.
  for (const zoo::Entry& entry : zoo::all()) {
    const SparseMatrix matrix = definite(entry.mesh);
    const RowMatrix<double> rhs = test::noise(matrix.rows(), 3, 1);
    const auto found = analysis(matrix);
    const auto again = analysis(matrix, found->ordering());
    EXPECT_EQ(again->ordering(), found->ordering()) << entry.name;
    const SparseCholesky a(matrix, found), b(matrix, again);
    EXPECT_EQ(a.factor_entries(), b.factor_entries()) << entry.name;
    EXPECT_EQ(a.solve(rhs), b.solve(rhs)) << entry.name;
  }
}

TEST_P(SymbolicCholeskyBackends, AnOrderingThatIsNoPermutationIsRefused) {
  const SparseMatrix matrix = definite(zoo::cube());
  const auto refused = [&](std::initializer_list<int> order) {
    const Eigen::VectorXi ordering =
        Eigen::VectorXi::Map(order.begin(), static_cast<Eigen::Index>(order.size()));
    return test::fails_with(ErrorCode::bad_option, {"ordering", "8 rows"},
                            [&] { analysis(matrix, ordering); });
  };
  EXPECT_TRUE(refused({0, 1, 2, 3, 4, 5, 6})) << "one is missing";
  EXPECT_TRUE(refused({0, 1, 2, 3, 4, 5, 6, 7, 8})) << "one too many";
  EXPECT_TRUE(refused({0, 1, 2, 3, 4, 5, 6, 6})) << "one named twice";
  EXPECT_TRUE(refused({0, 1, 2, 3, 4, 5, 6, 8})) << "one that is not there";
  EXPECT_TRUE(refused({-1, 1, 2, 3, 4, 5, 6, 7})) << "a negative one";
}

TEST_P(SymbolicCholeskyBackends, AMatrixOfAnotherPatternIsRefused) {
  const SparseMatrix matrix = definite(zoo::icosphere(1));
  const auto shared = analysis(matrix);
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"42", "162"},
                               [&] { SparseCholesky(definite(zoo::icosphere(2)), shared); }));
  SparseMatrix diagonal(42, 42);
  diagonal.setIdentity();
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"42 entries"},
                               [&] { SparseCholesky(diagonal, shared); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"square"},
                               [&] { SparseCholesky(SparseMatrix(42, 41), shared); }));
  EXPECT_TRUE(
      test::fails_with(ErrorCode::wrong_shape, {"square"}, [&] { analysis(SparseMatrix(3, 4)); }));
}

TEST_P(SymbolicCholeskyBackends, AnIndefiniteMatrixLeavesTheAnalysisUsable) {
  const SparseMatrix matrix = definite(zoo::perturbed_sphere(2, 1));
  const auto shared = analysis(matrix);
  SparseMatrix indefinite = matrix;
  indefinite.coeffRef(50, 50) = -1.0;
  EXPECT_TRUE(test::fails_with(ErrorCode::not_positive_definite, {"162 x 162"},
                               [&] { SparseCholesky(indefinite, shared); }));
  expect_solves(SparseCholesky(matrix, shared), matrix, test::noise(162, 3, 1));
}

TEST_P(SymbolicCholeskyBackends, FactorsOutliveMovesAndTheirAnalysis) {
  const SparseMatrix matrix = definite(zoo::perturbed_sphere(2, 1));
  const RowMatrix<double> rhs = test::noise(matrix.rows(), 3, 1);
  auto shared = analysis(matrix);
  std::vector<SparseCholesky> factors;
  for (int i = 0; i < 5; ++i) {  // grows, and moves them, several times
    factors.emplace_back(matrix, shared);
  }
  shared.reset();
  SparseCholesky last = std::move(factors.front());
  factors.erase(factors.begin());
  expect_solves(last, matrix, rhs);
  for (const SparseCholesky& factor : factors) {
    EXPECT_EQ(factor.solve(rhs), last.solve(rhs));
  }
}

TEST_P(SymbolicCholeskyBackends, AMatrixWithRoomBetweenItsColumns) {
  const SparseMatrix packed = definite(zoo::perturbed_sphere(1, 1));
  SparseMatrix loose = packed;
  loose.reserve(Eigen::VectorXi::Constant(loose.cols(), 9));
  ASSERT_FALSE(loose.isCompressed());
  const RowMatrix<double> rhs = test::noise(packed.rows(), 3, 1);
  expect_solves(SparseCholesky(loose, GetParam()), packed, rhs);
  expect_solves(SparseCholesky(loose, analysis(packed)), packed, rhs);
  expect_solves(SparseCholesky(packed, analysis(loose)), packed, rhs);
}

TEST_P(SymbolicCholeskyBackends, EveryNumberOfRightHandSides) {
  const SparseMatrix matrix = definite(zoo::perturbed_sphere(2, 1));
  const SparseCholesky factor(matrix, GetParam());
  const RowMatrix<double> all = test::noise(matrix.rows(), 40, 1);
  for (const int threads : {1, 2, 4}) {
    const test::Threads scope(threads);
    for (Eigen::Index columns = 1; columns <= 40; ++columns) {
      expect_solves(factor, matrix, all.leftCols(columns));
    }
  }
}

TEST_P(SymbolicCholeskyBackends, AColumnDoesNotDependOnItsNeighbours) {
  const SparseMatrix matrix = definite(zoo::perturbed_sphere(2, 1));
  const SparseCholesky factor(matrix, GetParam());
  RowMatrix<double> rhs = test::noise(matrix.rows(), 21, 1);
  const RowMatrix<double> alone = factor.solve(rhs.col(20));
  rhs.leftCols(20) *= 1e200;  // a leak of one part in 1e200 would show
  const RowMatrix<double> among = factor.solve(rhs).col(20);
  EXPECT_LT((among - alone).norm(), 1e-13 * alone.norm());
}

TEST_P(SymbolicCholeskyBackends, ThreadsSolveAndFactorAtOnce) {
  const SparseMatrix first = definite(zoo::icosphere(2)), second = definite(zoo::icosphere(2), 9.0);
  const auto shared = analysis(first);
  const SparseCholesky factor(first, shared);
  std::vector<std::thread> threads;
  std::vector<int> wrong(4, 0);
  std::vector<RowMatrix<double>> rhs, expected, other;
  for (const Eigen::Index columns : {1, 6, 11, 25}) {
    rhs.push_back(test::noise(first.rows(), columns, 1));
    const test::Threads scope(2);
    expected.push_back(factor.solve(rhs.back()));
    other.push_back(SparseCholesky(second, shared).solve(rhs.back()));
  }
  for (size_t t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      const test::Threads scope(2);
      for (int i = 0; i < 10; ++i) {
        wrong[t] += factor.solve(rhs[t]) != expected[t];
        wrong[t] += SparseCholesky(second, shared).solve(rhs[t]) != other[t];
      }
    });
  }
  for (auto& thread : threads) {
    thread.join();
  }
  EXPECT_EQ(wrong, std::vector<int>(4, 0));
}

INSTANTIATE_TEST_SUITE_P(Backends, SymbolicCholeskyBackends,
                         ::testing::Values(Backend::cholmod, Backend::eigen), [](const auto& info) {
                           return info.param == Backend::cholmod ? "cholmod" : "eigen";
                         });

// --- the supernodal solve alone
// -------------------------------------------------------------------

// L of a random definite matrix whose pattern is made of supernodes of the given widths, each
// coupled to every `step`-th row after it; laid out as the solves want it, and dense.
struct Layout {
  Layout(const std::vector<int>& widths, int step) {
    super.push_back(0);
    for (const int width : widths) {
      super.push_back(super.back() + width);
    }
    const int n = super.back();
    dense = Eigen::MatrixXd::Zero(n, n);
    uint64_t seed = 1;
    row_start.push_back(0);
    for (size_t s = 0; s < widths.size(); ++s) {
      const int first = super[s], after = super[s + 1];
      for (int i = first; i < after; ++i) {
        rows.push_back(i);
      }
      for (int i = after + static_cast<int>(s); i < n; i += step) {
        rows.push_back(i);
      }
      row_start.push_back(static_cast<int>(rows.size()));
      const int height = row_start[s + 1] - row_start[s];
      value_start.push_back(static_cast<int>(values.size()));
      for (int j = first; j < after; ++j) {
        const RowMatrix<double> column = test::noise(height, 1, seed++);
        for (int i = 0; i < height; ++i) {
          const int row = rows[static_cast<size_t>(row_start[s] + i)];
          // Above the diagonal, CHOLMOD leaves anything.
          const double value = row < j ? 1e300 : row == j ? 3.0 + column(i, 0) : column(i, 0);
          values.push_back(value);
          if (row >= j) {
            dense(row, j) = value;
          }
        }
      }
    }
    value_start.push_back(static_cast<int>(values.size()));
  }
  SupernodalFactor view() const {
    return {static_cast<int>(super.size()) - 1,
            super.data(),
            row_start.data(),
            value_start.data(),
            rows.data(),
            values.data()};
  }
  std::vector<int> super, row_start, value_start, rows;
  std::vector<double> values;
  Eigen::MatrixXd dense;
};

void expect_panels_solve() {
  const std::vector<std::vector<int>> supernodes = {
      {1}, {2}, {13}, {1, 1, 1, 1, 1}, {3, 4, 5, 6, 7}, {8, 1, 17, 2, 4}};
  for (const auto& widths : supernodes) {
    for (const int step : {1, 2, 5}) {
      const Layout layout(widths, step);
      const Eigen::Index n = layout.dense.rows();
      for (const int width : kPanelWidths) {
        std::vector<double> room(static_cast<size_t>(n * width) + 8);
        auto* const panel =
            reinterpret_cast<double*>((reinterpret_cast<uintptr_t>(room.data()) + 63) / 64 * 64);
        Eigen::Map<RowMatrix<double>> x(panel, n, width);
        const RowMatrix<double> known = test::noise(n, width, 7);
        x = layout.dense * (layout.dense.transpose() * known);
        const SupernodeRange all{0, layout.view().supernodes};
        forward_panel(layout.view(), all, panel, width);
        backward_panel(layout.view(), all, panel, width);
        const double condition =
            std::pow(layout.dense.norm(), 2) * std::pow(layout.dense.inverse().norm(), 2);
        EXPECT_LT((x - known).norm(), 1e-15 * condition * known.norm())
            << widths.size() << " supernodes, every " << step << " row, width " << width;
        x = layout.dense * known;
        forward_panel(layout.view(), all, panel, width);
        EXPECT_LT((x - known).norm(), 1e-15 * condition * known.norm()) << "forward";
        x = layout.dense.transpose() * known;
        backward_panel(layout.view(), all, panel, width);
        EXPECT_LT((x - known).norm(), 1e-15 * condition * known.norm()) << "backward";
      }
    }
  }
}

// The rows of some ranges.
std::vector<int> rows_of(const SupernodalFactor& factor,
                         const std::vector<SupernodeRange>& ranges) {
  std::vector<int> rows;
  for (const SupernodeRange& range : ranges) {
    for (int r = factor.super[range.first]; r < factor.super[range.last]; ++r) {
      rows.push_back(r);
    }
  }
  return rows;
}

TEST(SupernodeParts, ASmallFactorIsAllTop) {
  const Layout layout({3, 4, 5}, 1);
  const SupernodeParts parts = supernode_parts(layout.view(), layout.super.back());
  for (const auto& part : parts.parts) {
    EXPECT_TRUE(part.empty());
  }
  EXPECT_EQ(rows_of(layout.view(), parts.top).size(), 12u);
}

// Some hundred thousand entries: few columns are then solved for by the parts of the tree, many one
// panel after the other.
TEST(SupernodalSolve, FewColumnsOfALargeSystemAreThoseOfMany) {
  if (!SparseCholesky::available(Backend::cholmod)) {
    GTEST_SKIP() << "this build has no CHOLMOD";
  }
  const zoo::Mesh mesh = zoo::torus(120, 60);
  const SurfaceOperators operators{TriangleMesh(mesh.vertices, mesh.faces)};
  SparseMatrix matrix = operators.laplacian;
  matrix.diagonal() += operators.mass;
  const SparseCholesky factor(matrix, Backend::cholmod);
  ASSERT_GT(factor.factor_entries(), 100'000);
  const RowMatrix<double> rhs = test::noise(matrix.rows(), 12, 3);
  const RowMatrix<double> many = factor.solve(rhs);
  const RowMatrix<double> halves = factor.forward(rhs);
  for (const Eigen::Index count : {1, 3, 4}) {
    const RowMatrix<double> some = rhs.leftCols(count);
    const RowMatrix<double> few = factor.solve(some);
    const double size = few.norm();
    EXPECT_LT((few - many.leftCols(count)).norm(), 1e-12 * size) << count;
    EXPECT_LT((matrix * few - some).norm(), 1e-12 * some.norm() * size) << count;
    const RowMatrix<double> half = factor.forward(some);
    EXPECT_LT((half - halves.leftCols(count)).norm(), 1e-12 * half.norm()) << count;
    EXPECT_LT((factor.backward(half) - few).norm(), 1e-12 * size) << count;
    // The parts are the same for any number of threads, and so is every sum.
    const int threads = thread_count();
    for (const int other : {1, 2, 3}) {
      set_thread_count(other);
      EXPECT_EQ(factor.solve(some), few) << other << " threads";
    }
    set_thread_count(threads);
  }
}

TEST(SupernodalSolve, SolvesHandMadeFactors) { expect_panels_solve(); }

TEST(SupernodalSolveDeathTest, EveryInstructionSetSolves) {
  test::at_every_simd_level(expect_panels_solve);
}

}  // namespace
}  // namespace supple
