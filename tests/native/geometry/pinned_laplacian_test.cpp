// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/pinned_laplacian.h"

#include <Eigen/Cholesky>

#include "native/support.h"
#include "supple/geometry/surface_operators.h"

namespace supple {
namespace {

SurfaceOperators operators_of(const zoo::Mesh& mesh) {
  return SurfaceOperators(TriangleMesh(mesh.vertices, mesh.faces));
}

std::shared_ptr<const PinnedLaplacian> pinned(const SurfaceOperators& o) {
  return std::make_shared<const PinnedLaplacian>(o.laplacian, o.mass, o.component,
                                                 o.component_count);
}

// `each` vertices of each component (fewer where it has fewer), spread over its numbers.
Eigen::VectorXi some_points(const SurfaceOperators& operators, int each) {
  std::vector<std::vector<int>> of(static_cast<size_t>(operators.component_count));
  for (int i = 0; i < operators.component.size(); ++i) {
    of[static_cast<size_t>(operators.component[i])].push_back(i);
  }
  std::vector<int> points;
  for (const std::vector<int>& vertices : of) {
    const size_t count = std::min(static_cast<size_t>(each), vertices.size());
    for (size_t k = 0; k < count; ++k) {
      points.push_back(vertices[(k * vertices.size()) / count]);
    }
  }
  return Eigen::Map<Eigen::VectorXi>(points.data(), static_cast<Eigen::Index>(points.size()));
}

class BiharmonicZoo : public ::testing::TestWithParam<zoo::Entry> {
 protected:
  SurfaceOperators operators = operators_of(GetParam().mesh);
};

TEST_P(BiharmonicZoo, PassesThroughItsValues) {
  for (const int each : {1, 2, 7, 20}) {
    const Eigen::VectorXi points = some_points(operators, each);
    const BiharmonicInterpolation interpolation(pinned(operators), points);
    const RowMatrix<double> values = test::noise(points.size(), 4, 1);
    const RowMatrix<double> got = interpolation.solve(values);
    ASSERT_EQ(got.rows(), operators.mass.size());
    for (Eigen::Index i = 0; i < points.size(); ++i) {
      EXPECT_LT((got.row(points[i]) - values.row(i)).norm(), 1e-9) << each << " a component";
    }
  }
}

TEST_P(BiharmonicZoo, ReproducesEachComponentsConstantExactly) {
  const Eigen::VectorXi points = some_points(operators, 5);
  const BiharmonicInterpolation interpolation(pinned(operators), points);
  const RowMatrix<double> constants = test::noise(operators.component_count, 3, 3);
  RowMatrix<double> values(points.size(), 3);
  for (Eigen::Index i = 0; i < points.size(); ++i) {
    values.row(i) = constants.row(operators.component[points[i]]);
  }
  const RowMatrix<double> got = interpolation.solve(values);
  for (Eigen::Index v = 0; v < got.rows(); ++v) {
    EXPECT_EQ(got.row(v), constants.row(operators.component[v]));
  }
}

TEST_P(BiharmonicZoo, OnePointAComponentGivesItsValueEverywhere) {
  const Eigen::VectorXi points = some_points(operators, 1);
  const RowMatrix<double> values = test::noise(points.size(), 3, 4);
  const RowMatrix<double> got = BiharmonicInterpolation(pinned(operators), points).solve(values);
  for (Eigen::Index v = 0; v < got.rows(); ++v) {
    EXPECT_EQ(got.row(v), values.row(operators.component[v]));  // points are in component order
  }
}

TEST_P(BiharmonicZoo, AFormerOneChangesNothing) {
  const auto base = pinned(operators);
  const Eigen::VectorXi points = some_points(operators, 9), fewer = some_points(operators, 3);
  const BiharmonicInterpolation fresh(base, points), former(base, fewer);
  const RowMatrix<double> values = test::noise(points.size(), 3, 5);
  const RowMatrix<double> expected = fresh.solve(values);
  const double tolerance = 1e-12 * expected.norm();
  EXPECT_LT((BiharmonicInterpolation(base, points, &former).solve(values) - expected).norm(),
            tolerance);
  // The same points in another order, and fewer of them, from the larger set.
  const Eigen::VectorXi turned = points.reverse();
  EXPECT_LT(
      (BiharmonicInterpolation(base, turned, &fresh).solve(values.colwise().reverse()) - expected)
          .norm(),
      10.0 * tolerance);  // their system is eliminated in another order
  const RowMatrix<double> few = test::noise(fewer.size(), 3, 6);
  const RowMatrix<double> few_expected = former.solve(few);
  EXPECT_LT((BiharmonicInterpolation(base, fewer, &fresh).solve(few) - few_expected).norm(),
            1e-12 * few_expected.norm());
}

SUPPLE_OVER_THE_ZOO(BiharmonicZoo);

// The minimum of x^T W M^-1 W x through the values, densely.
RowMatrix<double> densely(const SurfaceOperators& operators, const Eigen::VectorXi& points,
                          const RowMatrix<double>& values) {
  const Eigen::MatrixXd w(operators.laplacian);
  const Eigen::MatrixXd energy = w * operators.mass.cwiseInverse().asDiagonal() * w;
  std::vector<bool> given(static_cast<size_t>(w.rows()), false);
  RowMatrix<double> result = RowMatrix<double>::Zero(w.rows(), values.cols());
  for (Eigen::Index i = 0; i < points.size(); ++i) {
    given[static_cast<size_t>(points[i])] = true;
    result.row(points[i]) = values.row(i);
  }
  std::vector<int> free;
  for (int i = 0; i < w.rows(); ++i) {
    if (!given[static_cast<size_t>(i)]) {
      free.push_back(i);
    }
  }
  const Eigen::MatrixXd load = -(energy * result)(free, Eigen::all);
  const Eigen::MatrixXd inner = energy(free, free);
  const Eigen::MatrixXd solution = inner.ldlt().solve(load);
  result(free, Eigen::all) = solution;
  return result;
}

TEST(BiharmonicInterpolation, MissesValuesByAsMuchAsTheirCompliance) {
  for (const zoo::Mesh& mesh : {zoo::perturbed_sphere(2, 3), zoo::disc(6, 12),
                                zoo::joined(zoo::icosphere(1), zoo::cube())}) {
    const SurfaceOperators operators = operators_of(mesh);
    const Eigen::VectorXi points = some_points(operators, 5);
    const RowMatrix<double> values = test::noise(points.size(), 3, 7);
    // References are among the soft ones, and some points are passed through.
    Eigen::VectorXd compliance(points.size());
    for (Eigen::Index i = 0; i < points.size(); ++i) {
      compliance[i] = i % 3 == 2 ? 0.0 : 1e-3 * static_cast<double>(1 + i);
    }
    // x^T W M^-1 W x + sum (x - value)^2 / compliance, densely; almost none stands for none.
    const Eigen::MatrixXd w(operators.laplacian);
    Eigen::MatrixXd system = w * operators.mass.cwiseInverse().asDiagonal() * w;
    Eigen::MatrixXd load = Eigen::MatrixXd::Zero(w.rows(), 3);
    for (Eigen::Index i = 0; i < points.size(); ++i) {
      const double weight = 1.0 / std::max(compliance[i], 1e-9);
      system(points[i], points[i]) += weight;
      load.row(points[i]) += weight * values.row(i);
    }
    const Eigen::MatrixXd expected = system.ldlt().solve(load);
    const RowMatrix<double> got =
        BiharmonicInterpolation(pinned(operators), points, nullptr, compliance).solve(values);
    EXPECT_LT((got - expected).norm(), 1e-5 * expected.norm());
    EXPECT_GT((got(points, Eigen::all) - values).norm(), 0.01 * values.norm());
  }
}

TEST(BiharmonicInterpolation, IsTheLeastBilaplacianEnergy) {
  for (const zoo::Mesh& mesh : {zoo::perturbed_sphere(2, 3), zoo::disc(6, 12), zoo::torus(12, 7),
                                zoo::joined(zoo::icosphere(1), zoo::cube())}) {
    const SurfaceOperators operators = operators_of(mesh);
    for (const int each : {2, 5, 12}) {
      const Eigen::VectorXi points = some_points(operators, each);
      const RowMatrix<double> values = test::noise(points.size(), 3, 7);
      const RowMatrix<double> expected = densely(operators, points, values);
      // The bilaplacian's condition, about the square of the Laplacian's, is up to 1e6 here.
      EXPECT_LT(
          (BiharmonicInterpolation(pinned(operators), points).solve(values) - expected).norm(),
          1e-8 * expected.norm())
          << mesh.vertices.rows() << " vertices, " << each << " points each";
    }
  }
}

TEST(BiharmonicInterpolation, DoesNotDependOnWhichVertexIsPinned) {
  zoo::Mesh mesh = zoo::perturbed_sphere(2, 3);
  const SurfaceOperators a = operators_of(mesh);
  const auto last = static_cast<int>(mesh.vertices.rows()) - 1;
  mesh.vertices = mesh.vertices.colwise().reverse().eval();
  mesh.faces = last - mesh.faces.array();
  const SurfaceOperators b = operators_of(mesh);
  const Eigen::VectorXi points = Eigen::Vector4i(0, 30, 71, 155);
  const Eigen::VectorXi turned = last - points.array();
  const RowMatrix<double> values = test::noise(4, 3, 1);
  const RowMatrix<double> from_a = BiharmonicInterpolation(pinned(a), points).solve(values);
  const RowMatrix<double> from_b = BiharmonicInterpolation(pinned(b), turned).solve(values);
  EXPECT_LT((from_a - from_b.colwise().reverse()).norm(), 1e-10 * from_a.norm());
}

TEST(BiharmonicInterpolation, AFormerOneOfAnotherMeshIsNotUsed) {
  const SurfaceOperators a = operators_of(zoo::perturbed_sphere(1, 3)),
                         b = operators_of(zoo::icosphere(1));
  const Eigen::VectorXi points = some_points(a, 6);
  const BiharmonicInterpolation former(pinned(b), points);
  const RowMatrix<double> values = test::noise(points.size(), 3, 1);
  const auto base = pinned(a);
  EXPECT_EQ(BiharmonicInterpolation(base, points, &former).solve(values),
            BiharmonicInterpolation(base, points).solve(values));
}

TEST(BiharmonicInterpolation, Errors) {
  const auto base = pinned(operators_of(zoo::two_spheres(1)));
  const RowMatrix<double> values = test::noise(3, 3, 1);
  EXPECT_TRUE(test::fails_with(ErrorCode::no_handles, {"Component 1"},
                               [&] { BiharmonicInterpolation(base, Eigen::Vector2i(0, 5)); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::overlapping_handles, {"5", "twice"},
                               [&] { BiharmonicInterpolation(base, Eigen::Vector3i(5, 50, 5)); }));
  for (const int bad : {-1, 84}) {
    EXPECT_TRUE(test::fails_with(ErrorCode::index_out_of_range, {std::to_string(bad).c_str()}, [&] {
      BiharmonicInterpolation(base, Eigen::Vector3i(5, 50, bad));
    }));
  }
  const BiharmonicInterpolation interpolation(base, Eigen::Vector2i(0, 50));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"2 points", "3 values"},
                               [&] { interpolation.solve(values); }));
}

}  // namespace
}  // namespace supple
