// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/spectral/functional_map.h"

#include <omp.h>

#include <Eigen/QR>
#include <algorithm>
#include <limits>
#include <numeric>
#include <random>

#include "native/support.h"
#include "supple/core/nearest_rows.h"
#include "supple/geometry/operators.h"

namespace supple {
namespace {

Eigenbasis basis_of(const zoo::Mesh& mesh, int count) {
  return eigenbasis(cotan_laplacian(mesh.vertices, mesh.faces),
                    lumped_mass(mesh.vertices, mesh.faces), {.count = count});
}

Eigen::VectorXi identity(Eigen::Index n) {
  return Eigen::VectorXi::LinSpaced(n, 0, static_cast<int>(n) - 1);
}

Eigen::VectorXi shuffled(Eigen::Index n, unsigned seed) {
  Eigen::VectorXi order = identity(n);
  std::mt19937 generator(seed);
  for (Eigen::Index i = n - 1; i > 0; --i) {
    std::swap(order[i], order[static_cast<Eigen::Index>(generator() % (i + 1))]);
  }
  return order;
}

// The mesh with vertex i at place[i], turned, moved and scaled.
zoo::Mesh copy_of(const zoo::Mesh& mesh, const Eigen::VectorXi& place, double scale) {
  zoo::Mesh copy = mesh;
  for (Eigen::Index i = 0; i < place.size(); ++i) {
    copy.vertices.row(place[i]) = scale * mesh.vertices.row(i) * test::rotation(1);
  }
  copy.vertices.rowwise() += Eigen::RowVector3d(1.0, 2.0, 3.0);
  for (Eigen::Index f = 0; f < mesh.faces.size(); ++f) {
    copy.faces.data()[f] = place[mesh.faces.data()[f]];
  }
  return copy;
}

Eigen::VectorXi brute_force(const RowMatrix<double>& queries, const RowMatrix<double>& points) {
  Eigen::VectorXi nearest(queries.rows());
  for (Eigen::Index i = 0; i < queries.rows(); ++i) {
    (points.rowwise() - queries.row(i)).rowwise().squaredNorm().minCoeff(&nearest[i]);
  }
  return nearest;
}

Eigen::Index matches(const Eigen::VectorXi& a, const Eigen::VectorXi& b) {
  return (a.array() == b.array()).count();
}

// --- nearest rows
// ---------------------------------------------------------------------------------

TEST(NearestRows, AreThoseOfBruteForce) {
  for (const auto& [q, p, k] : std::vector<std::array<Eigen::Index, 3>>{
           {1, 1, 1}, {5, 3, 2}, {127, 1023, 7}, {300, 2500, 40}, {129, 1025, 33}, {10, 5, 0}}) {
    for (const double scale : {1.0, 1e-30, 1e30}) {
      const RowMatrix<double> queries = scale * test::noise(q, k, 1),
                              points = scale * test::noise(p, k, 2);
      EXPECT_EQ(nearest_rows(queries, points), brute_force(queries, points))
          << q << " " << p << " " << k << " " << scale;
    }
  }
}

TEST(NearestRows, AreThoseOfBruteForceWhereMostPointsAreFar) {
  // Waves on a square, as eigenfunctions are: nearly all groups of points are passed over, by their
  // middles or by the first of their numbers. Queries lie off the points, by nothing up to far.
  const Eigen::Index count = 3000;
  for (const Eigen::Index k : {10, 30, 47, 48, 90}) {
    const RowMatrix<double> places = test::noise(2 * count, 2, 7);
    RowMatrix<double> rows(places.rows(), k);
    for (Eigen::Index j = 0; j < k; ++j) {
      rows.col(j) = (places.col(0).array() * static_cast<double>(j % 9)).cos() *
                    (places.col(1).array() * static_cast<double>(j / 9)).cos();
    }
    for (const double off : {0.0, 0.02, 0.3, 3.0}) {
      const RowMatrix<double> queries = rows.topRows(count) + off * test::noise(count, k, 8);
      RowMatrix<double> points = rows.bottomRows(count);
      points.bottomRows(500) = points.topRows(500);  // twins: the first is meant
      EXPECT_EQ(nearest_rows(queries, points), brute_force(queries, points)) << k << " " << off;
    }
  }
}

TEST(NearestRows, AreExactWhereSinglePrecisionCannotTell) {
  // Points far from 0 that differ in the twelfth digit; every query is one of them.
  RowMatrix<double> points = 1e-11 * test::noise(2000, 6, 1);
  points.array() += 1.0;
  const Eigen::VectorXi order = shuffled(2000, 3);
  RowMatrix<double> queries(500, 6);
  for (Eigen::Index i = 0; i < queries.rows(); ++i) {
    queries.row(i) = points.row(order[i]);
  }
  EXPECT_EQ(nearest_rows(queries, points), order.head(500));
}

TEST(NearestRows, TiesGoToTheLowestIndex) {
  RowMatrix<double> points = test::noise(3000, 5, 1);
  points.bottomRows(1500) = points.topRows(1500);
  const Eigen::VectorXi nearest = nearest_rows(points, points);
  EXPECT_EQ(nearest.head(1500), identity(1500));
  EXPECT_EQ(nearest.tail(1500), identity(1500));
  EXPECT_EQ(nearest_rows(points, RowMatrix<double>::Zero(2000, 5)), Eigen::VectorXi::Zero(3000));
}

TEST(NearestRows, DoNotDependOnTheThreads) {
  const RowMatrix<double> queries = test::noise(1000, 12, 1), points = test::noise(1500, 12, 2);
  const Eigen::VectorXi many = nearest_rows(queries, points);
  const int threads = omp_get_max_threads();
  omp_set_num_threads(1);
  const Eigen::VectorXi one = nearest_rows(queries, points);
  omp_set_num_threads(threads);
  EXPECT_EQ(one, many);
}

TEST(NearestRowsErrors, ShapesAndNumbers) {
  const RowMatrix<double> a = test::noise(4, 3, 1);
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"4 rows of 3", "rows of 2"},
                               [&] { nearest_rows(test::noise(5, 2, 1), a); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"0 rows"},
                               [&] { nearest_rows(a, RowMatrix<double>(0, 3)); }));
  for (const bool in_queries : {false, true}) {
    RowMatrix<double> bad = a;
    bad(2, 1) = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(test::fails_with(ErrorCode::not_finite, {"NaN"}, [&] {
      in_queries ? nearest_rows(bad, a) : nearest_rows(a, bad);
    }));
  }
}

// --- functional and point maps
// --------------------------------------------------------------------

TEST(FunctionalMap, OfTheIdentityIsTheIdentity) {
  const Eigenbasis basis = basis_of(zoo::perturbed_sphere(2, 7), 30);
  const Eigen::VectorXi same = identity(basis.mass.size());
  const RowMatrix<double> map = functional_map(basis, basis, same, 30, 20);
  EXPECT_LT((map - RowMatrix<double>::Identity(30, 20)).cwiseAbs().maxCoeff(), 1e-8);
  const RowMatrix<double> square = functional_map(basis, basis, same, 30, 30);
  EXPECT_EQ(point_map(basis, basis, square), same);
}

TEST(FunctionalMap, PullsFunctionsBack) {
  const Eigenbasis source = basis_of(zoo::perturbed_sphere(2, 7), 25);
  const Eigenbasis target = basis_of(zoo::torus(14, 9), 18);
  const Eigen::VectorXi map =
      (test::noise(source.mass.size(), 1, 4).array() + 1.0).matrix().unaryExpr([&](double x) {
        return static_cast<int>(0.5 * x * static_cast<double>(target.mass.size()));
      });
  const RowMatrix<double> c = functional_map(source, target, map, 25, 18);
  RowMatrix<double> pulled(map.size(), 18);
  for (Eigen::Index i = 0; i < map.size(); ++i) {
    pulled.row(i) = target.functions.row(map[i]);
  }
  const double scale = std::sqrt(target.mass.sum() / source.mass.sum());
  const RowMatrix<double> expected = scale * source.coefficients(pulled, 25);
  EXPECT_LT((c - expected).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(FunctionalMap, OfAScaledCopyIsTheIdentityUpToSigns) {
  const zoo::Mesh mesh = zoo::perturbed_sphere(3, 7);
  const Eigen::VectorXi place = shuffled(mesh.vertices.rows(), 5);
  const Eigenbasis source = basis_of(mesh, 30), target = basis_of(copy_of(mesh, place, 7.0), 30);
  const RowMatrix<double> map = functional_map(source, target, place, 30, 30);
  EXPECT_LT((map.cwiseAbs() - RowMatrix<double>::Identity(30, 30)).cwiseAbs().maxCoeff(), 1e-5);
  EXPECT_EQ(point_map(source, target, map), place);
}

TEST(FunctionalMapErrors, Inputs) {
  const Eigenbasis basis = basis_of(zoo::icosphere(1), 10);
  Eigen::VectorXi map = identity(42);
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"11 functions", "target", "10"},
                               [&] { functional_map(basis, basis, map, 10, 11); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"41 entries", "42"},
                               [&] { functional_map(basis, basis, map.head(41), 5, 5); }));
  map[7] = 42;
  EXPECT_TRUE(test::fails_with(ErrorCode::index_out_of_range, {"Entry 7", "42 vertices"},
                               [&] { functional_map(basis, basis, map, 5, 5); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"12 functions", "source"},
                               [&] { point_map(basis, basis, RowMatrix<double>::Zero(12, 5)); }));
}

// --- zoomout
// --------------------------------------------------------------------------------------

class ZoomoutTest : public ::testing::Test {
 protected:
  ZoomoutTest()
      : mesh(zoo::perturbed_sphere(3, 7)),
        place(shuffled(mesh.vertices.rows(), 5)),
        source(basis_of(mesh, 60)),
        target(basis_of(copy_of(mesh, place, 3.0), 60)) {}

  // `place` with a share of its entries wrong.
  Eigen::VectorXi damaged(double share) const {
    Eigen::VectorXi map = place;
    const Eigen::VectorXi which = shuffled(map.size(), 8), other = shuffled(map.size(), 9);
    for (Eigen::Index i = 0; i < static_cast<Eigen::Index>(share * map.size()); ++i) {
      map[which[i]] = other[i];
    }
    return map;
  }

  zoo::Mesh mesh;
  Eigen::VectorXi place;
  Eigenbasis source, target;
};

TEST_F(ZoomoutTest, RecoversACopyFromAMapOfWhichThreeTenthsAreWrong) {
  const Eigen::VectorXi start = damaged(0.3);
  EXPECT_LT(matches(start, place), 0.72 * static_cast<double>(place.size()));
  const Zoomout refined = zoomout(source, target, start, {.from = 10, .to = 60, .step = 5});
  EXPECT_EQ(matches(refined.point_map, place), place.size());
  EXPECT_EQ(refined.functional_map.rows(), 60);
}

TEST_F(ZoomoutTest, IsItsRoundsOneByOne) {
  const Eigen::VectorXi start = damaged(0.5);
  Eigen::VectorXi map = start;
  RowMatrix<double> c;
  for (const int count : {20, 27, 34, 40}) {
    c = functional_map(source, target, map, count, count);
    map = point_map(source, target, c);
  }
  const Zoomout refined = zoomout(source, target, start, {.from = 20, .to = 40, .step = 7});
  EXPECT_EQ(refined.point_map, map);
  EXPECT_EQ(refined.functional_map, c);
}

TEST_F(ZoomoutTest, OfSamplesIsItsRoundsByLeastSquaresOverThem) {
  const Eigen::VectorXi start = damaged(0.3), samples = shuffled(place.size(), 4).head(200);
  RowMatrix<double> c = functional_map(source, target, start, 20, 20);
  for (const int count : {27, 34, 40}) {
    const Eigen::VectorXi map = point_map(source, target, c);
    const Eigen::MatrixXd own = source.functions(samples, Eigen::seqN(0, count));
    const Eigen::MatrixXd other =
        target.functions(Eigen::VectorXi(map(samples)), Eigen::seqN(0, count));
    const double scale = std::sqrt(target.mass.sum() / source.mass.sum());
    c = scale * own.colPivHouseholderQr().solve(other);
  }
  const Zoomout refined =
      zoomout(source, target, start, {.from = 20, .to = 40, .step = 7, .samples = samples});
  EXPECT_LT((refined.functional_map - c).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_EQ(refined.point_map, point_map(source, target, refined.functional_map));
  EXPECT_EQ(matches(refined.point_map, place), place.size());
}

TEST_F(ZoomoutTest, RefusesTooFewSamplesAndWrongOnes) {
  Eigen::VectorXi samples = shuffled(place.size(), 4).head(40);
  const auto refine = [&] {
    zoomout(source, target, place, {.from = 20, .to = 40, .step = 7, .samples = samples});
  };
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"40 samples", "40 functions"}, refine));
  samples = Eigen::VectorXi::Constant(41, static_cast<int>(place.size()));
  EXPECT_TRUE(test::fails_with(ErrorCode::index_out_of_range, {"Sample"}, refine));
}

TEST_F(ZoomoutTest, ReportsAndCanBeCancelled) {
  Progress progress;
  zoomout(source, target, place, {.from = 10, .to = 20, .step = 5}, ProgressRange(&progress));
  EXPECT_DOUBLE_EQ(progress.fraction(), 1.0);
  EXPECT_NE(progress.stage().find("20 functions"), std::string::npos);
  Progress cancelled;
  cancelled.cancel();
  EXPECT_TRUE(test::fails_with(ErrorCode::cancelled, {}, [&] {
    zoomout(source, target, place, {.from = 10, .to = 20, .step = 5}, ProgressRange(&cancelled));
  }));
}

TEST_F(ZoomoutTest, RefusesRoundsThatDoNotExist) {
  for (const ZoomoutOptions& options :
       {ZoomoutOptions{0, 10, 5}, ZoomoutOptions{10, 9, 5}, ZoomoutOptions{10, 20, 0}}) {
    EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"can't be refined"},
                                 [&] { zoomout(source, target, place, options); }));
  }
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"61 functions", "60"}, [&] {
    zoomout(source, target, place, {.from = 20, .to = 61, .step = 5});
  }));
}

}  // namespace
}  // namespace supple
