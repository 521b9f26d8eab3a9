// SPDX-License-Identifier: GPL-3.0-or-later
#include "geometry/supernodal_solve.h"

#include <Eigen/LU>
#include <cmath>
#include <cstdint>
#include <vector>

#include "native/support.h"
#include "supple/core/parallel.h"
#include "supple/geometry/sparse_cholesky.h"
#include "supple/geometry/surface_operators.h"

namespace supple {
namespace {

// L of a random definite matrix whose pattern is made of supernodes of the given widths, each
// coupled to every `step`-th row after it; laid out as CHOLMOD does it, and dense.
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
      const SupernodalFactor factor = layout.view();
      const SupernodeRange all{0, factor.supernodes}, low{0, factor.supernodes / 2},
          high{factor.supernodes / 2, factor.supernodes};
      const Eigen::Index n = layout.dense.rows();
      for (const int width : kPanelWidths) {
        std::vector<double> room(static_cast<size_t>(n * width) + 8);
        auto* const panel =
            reinterpret_cast<double*>((reinterpret_cast<uintptr_t>(room.data()) + 63) / 64 * 64);
        Eigen::Map<RowMatrix<double>> x(panel, n, width);
        const RowMatrix<double> known = test::noise(n, width, 7);
        const double condition = layout.dense.norm() * layout.dense.inverse().norm();
        const auto expect_known = [&](const char* what) {
          EXPECT_LT((x - known).norm(), 1e-15 * condition * known.norm())
              << what << ", " << widths.size() << " supernodes, every " << step << " row, width "
              << width;
        };
        x = layout.dense * known;
        forward_panel(factor, all, panel, width);
        expect_known("forward");
        x = layout.dense.transpose() * known;
        backward_panel(factor, all, panel, width);
        expect_known("backward");
        // In two goes, in the order of the substitution.
        x = layout.dense * known;
        forward_panel(factor, low, panel, width);
        forward_panel(factor, high, panel, width);
        expect_known("forward in two");
        x = layout.dense.transpose() * known;
        backward_panel(factor, high, panel, width);
        backward_panel(factor, low, panel, width);
        expect_known("backward in two");
      }
    }
  }
}

TEST(SupernodalSolve, SolvesHandMadeFactors) { expect_panels_solve(); }

TEST(SupernodalSolveDeathTest, EveryInstructionSetSolves) {
  test::at_every_simd_level(expect_panels_solve);
}

// Every row is in one part or at the top, and no part's supernode reaches into another part.
void expect_cut(const SupernodalFactor& factor, int rows, const SupernodeParts& parts) {
  std::vector<int> owner(static_cast<size_t>(rows), -2);
  const auto claim = [&](const std::vector<SupernodeRange>& ranges, int who) {
    int before = 0;
    for (const SupernodeRange& range : ranges) {
      EXPECT_GE(range.first, before) << "not ascending";
      before = range.last;
      for (int r = factor.super[range.first]; r < factor.super[range.last]; ++r) {
        EXPECT_EQ(owner[static_cast<size_t>(r)], -2) << "row " << r << " twice";
        owner[static_cast<size_t>(r)] = who;
      }
    }
  };
  for (int p = 0; p < SupernodeParts::kParts; ++p) {
    claim(parts.parts[p], p);
  }
  claim(parts.top, -1);
  for (int s = 0; s < factor.supernodes; ++s) {
    const int who = owner[static_cast<size_t>(factor.super[s])];
    EXPECT_GE(who, -1) << "supernode " << s << " is nowhere";
    for (int i = factor.row_start[s]; i < factor.row_start[s + 1]; ++i) {
      const int other = owner[static_cast<size_t>(factor.rows[i])];
      EXPECT_TRUE(other == who || other == -1) << "supernode " << s;
    }
  }
}

TEST(SupernodeParts, OfASmallFactorAreTheTopAlone) {
  const Layout layout({8, 1, 17, 2, 4}, 2);
  const SupernodeParts parts =
      supernode_parts(layout.view(), static_cast<int>(layout.super.back()));
  for (const auto& part : parts.parts) {
    EXPECT_TRUE(part.empty());
  }
  EXPECT_TRUE(parts.top_rows.empty());
  expect_cut(layout.view(), layout.super.back(), parts);
}

// `leaves` dense supernodes of `width` columns that meet only in the last one, as the halves,
// quarters and so on of a nested dissection do.
struct Star {
  Star(int leaves, int width, int root) {
    const int n = leaves * width + root;
    super.push_back(0);
    row_start.push_back(0);
    value_start.push_back(0);
    for (int s = 0; s <= leaves; ++s) {
      const int first = s * width, after = s < leaves ? first + width : n;
      super.push_back(after);
      for (int r = first; r < after; ++r) {
        rows.push_back(r);
      }
      for (int r = leaves * width; s < leaves && r < n; ++r) {
        rows.push_back(r);
      }
      row_start.push_back(static_cast<int>(rows.size()));
      value_start.push_back(value_start.back() +
                            (row_start.back() - row_start[static_cast<size_t>(s)]) *
                                (after - first));
    }
  }
  SupernodalFactor view() const {
    return {static_cast<int>(super.size()) - 1,
            super.data(),
            row_start.data(),
            value_start.data(),
            rows.data(),
            nullptr};
  }
  std::vector<int> super, row_start, value_start, rows;
};

TEST(SupernodeParts, DoNotTouchAndShareTheWork) {
  const Star star(23, 60, 90);
  const SupernodeParts parts = supernode_parts(star.view(), star.super.back());
  expect_cut(star.view(), star.super.back(), parts);
  for (const auto& part : parts.parts) {
    int supernodes = 0;
    for (const SupernodeRange& range : part) {
      supernodes += range.last - range.first;
    }
    EXPECT_GE(supernodes, 5);
    EXPECT_LE(supernodes, 6);
  }
  EXPECT_EQ(parts.top_rows.size(), 90u);
}

// Some hundred thousand entries: few columns are then solved for by the parts of the tree, many one
// panel after the other.
TEST(SupernodalSolve, FewColumnsOfALargeSystemAreThoseOfMany) {
  if (!SparseCholesky::available(CholeskyBackend::cholmod)) {
    GTEST_SKIP() << "this build has no CHOLMOD";
  }
  const zoo::Mesh mesh = zoo::torus(120, 60);
  const SurfaceOperators operators{TriangleMesh(mesh.vertices, mesh.faces)};
  SparseMatrix matrix = operators.laplacian;
  matrix.diagonal() += operators.mass;
  const SparseCholesky factor(matrix, CholeskyBackend::cholmod);
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

// Large enough that few columns are solved by parts; many are always solved by columns.
TEST(SupernodeParts, FewColumnsAreSolvedAsAmongMany) {
  for (const zoo::Mesh& mesh : {zoo::icosphere(5), zoo::grid(70, 70, 1.0),
                                zoo::joined(zoo::icosphere(4), zoo::icosphere(4))}) {
    const SurfaceOperators operators{TriangleMesh(mesh.vertices, mesh.faces)};
    SparseMatrix matrix = operators.laplacian;
    matrix.diagonal() += operators.mass;
    const SparseCholesky factor(matrix);
    const RowMatrix<double> many = test::noise(matrix.rows(), 20, 1);
    const RowMatrix<double> solved = factor.solve(many), half = factor.forward(many),
                            back = factor.backward(many);
    for (const Eigen::Index columns : {1, 3, 4, 5}) {
      const RowMatrix<double> few = many.leftCols(columns);
      for (const int count : {1, 2, 3, 8}) {
        const test::Threads threads(count);
        const RowMatrix<double> got = factor.solve(few);
        EXPECT_LT((got - solved.leftCols(columns)).norm(), 1e-13 * got.norm());
        EXPECT_LT((factor.forward(few) - half.leftCols(columns)).norm(), 1e-13 * half.norm());
        EXPECT_LT((factor.backward(few) - back.leftCols(columns)).norm(), 1e-13 * back.norm());
        const test::Threads one(1);
        EXPECT_EQ(factor.solve(few), got) << columns << " columns, " << count << " threads";
      }
    }
  }
}

}  // namespace
}  // namespace supple
