// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/spectral/sampling.h"

#include <set>
#include <vector>

#include "native/support.h"
#include "supple/geometry/surface_operators.h"

namespace supple {
namespace {

Eigenbasis basis_of(const zoo::Mesh& mesh, int count) {
  const SurfaceOperators operators(TriangleMesh(mesh.vertices, mesh.faces));
  return eigenbasis(operators.laplacian, operators.mass, {.count = count});
}

TEST(FarthestPoints, AreDistinctAndAscending) {
  const Points points = test::noise(400, 3, 1);
  const Eigen::VectorXi samples = farthest_point_samples(points, 60);
  ASSERT_EQ(samples.size(), 60);
  for (Eigen::Index i = 1; i < samples.size(); ++i) {
    EXPECT_LT(samples[i - 1], samples[i]);
  }
}

TEST(FarthestPoints, AreDistinctWherePointsCoincide) {
  // Seams: 20 places, each with 10 vertices on it.
  Points points(200, 3);
  const Points places = test::noise(20, 3, 1);
  for (int i = 0; i < 200; ++i) {
    points.row(i) = places.row(i % 20);
  }
  const Eigen::VectorXi samples = farthest_point_samples(points, 50);
  const std::set<int> distinct(samples.begin(), samples.end());
  EXPECT_EQ(distinct.size(), 50U);
}

TEST(FarthestPoints, CoverThePoints) {
  const Points points = zoo::icosphere(3).vertices;
  const Eigen::VectorXi samples = farthest_point_samples(points, 100);
  double gap = 0.0;
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    double nearest = 4.0;
    for (const int s : samples) {
      nearest = std::min(nearest, (points.row(i) - points.row(s)).norm());
    }
    gap = std::max(gap, nearest);
  }
  // 100 caps that cover the unit sphere have a radius of 0.2 at least; twice that is spread well.
  EXPECT_LT(gap, 0.4);
}

TEST(FarthestPoints, DoNotDependOnHowTheyAreTurned) {
  for (const zoo::Mesh& mesh :
       {zoo::icosphere(3), zoo::square_tower(4, 12), zoo::torus(30, 16), zoo::grid(20, 20, 0.1)}) {
    const Eigen::VectorXi samples = farthest_point_samples(mesh.vertices, 90);
    for (uint64_t which = 0; which < 4; ++which) {
      const Points turned = mesh.vertices * test::rotation(which);
      EXPECT_EQ(farthest_point_samples(turned, 90), samples);
    }
  }
}

TEST(FarthestPoints, AllWhereThereAreNoMore) {
  const Points points = test::noise(5, 3, 1);
  EXPECT_EQ(farthest_point_samples(points, 5), Eigen::VectorXi::LinSpaced(5, 0, 4));
  EXPECT_EQ(farthest_point_samples(points, 50), Eigen::VectorXi::LinSpaced(5, 0, 4));
}

class SampledDomain : public ::testing::TestWithParam<zoo::Entry> {};

TEST_P(SampledDomain, ProjectorIsExactOnTheSpan) {
  const zoo::Mesh& mesh = GetParam().mesh;
  const Eigenbasis basis = basis_of(mesh, 30);
  const Eigen::VectorXi samples = farthest_point_samples(mesh.vertices, 120);
  const auto domain = sampled_domain<double>(basis, 25, mesh.vertices, samples);
  ASSERT_EQ(domain.functions.rows(), 120);
  ASSERT_EQ(domain.projector.rows(), 25);
  const Eigen::MatrixXd product = domain.projector * domain.functions;
  EXPECT_LT((product - Eigen::MatrixXd::Identity(25, 25)).cwiseAbs().maxCoeff(), 1e-8);
}

std::vector<zoo::Entry> larger_shapes() {
  return {{.name = "sphere", .mesh = zoo::icosphere(3)},
          {.name = "perturbed", .mesh = zoo::perturbed_sphere(3, 1)},
          {.name = "two_spheres", .mesh = zoo::two_spheres(2)},
          {.name = "cylinder", .mesh = zoo::open_cylinder(20, 20)},
          {.name = "slivers", .mesh = zoo::with_slivers(zoo::icosphere(2), 1e-3)}};
}
INSTANTIATE_TEST_SUITE_P(Shapes, SampledDomain, ::testing::ValuesIn(larger_shapes()),
                         test::entry_name);

TEST(SampledDomainLimits, WithEveryVertexIsTheFullDomain) {
  const zoo::Mesh mesh = zoo::perturbed_sphere(1, 3);
  const Eigenbasis basis = basis_of(mesh, 20);
  const auto n = static_cast<int>(mesh.vertices.rows());
  const auto sampled =
      sampled_domain<double>(basis, 15, mesh.vertices, Eigen::VectorXi::LinSpaced(n, 0, n - 1));
  const auto full = full_domain<double>(basis, 15);
  EXPECT_EQ(sampled.functions, full.functions);
  EXPECT_EQ(sampled.projector, full.projector);
}

TEST(FullDomain, ProjectsAsTheBasisDoes) {
  const zoo::Mesh mesh = zoo::perturbed_sphere(1, 3);
  const Eigenbasis basis = basis_of(mesh, 20);
  const auto domain = full_domain<double>(basis, 15);
  const RowMatrix<double> field = test::noise(mesh.vertices.rows(), 4, 1);
  const RowMatrix<double> projected = domain.functions * (domain.projector * field);
  EXPECT_LT((projected - basis.project(field, 15)).norm(), 1e-13 * field.norm());
}

}  // namespace
}  // namespace supple
