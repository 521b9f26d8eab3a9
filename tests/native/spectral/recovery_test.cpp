// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/spectral/recovery.h"

#include <Eigen/Dense>
#include <limits>

#include "native/support.h"

namespace supple {
namespace {

constexpr RecoveryOptions kLiteral{.form = RecoveryForm::literal};

SurfaceOperators operators_of(const zoo::Mesh& mesh) {
  return SurfaceOperators(TriangleMesh(mesh.vertices, mesh.faces));
}

// The mass scaled to the sum 1.
Eigen::VectorXd unit_mass(const SurfaceOperators& operators) {
  return operators.mass / operators.mass.sum();
}

// The product form's equation as it is printed, all matrices dense.
Points dense_product(const SurfaceOperators& operators, double s, double b, const Points& coarse,
                     const Points& d) {
  const Eigen::VectorXd m = unit_mass(operators);
  const Eigen::MatrixXd w = operators.laplacian, mass = m.asDiagonal(),
                        inverse = m.cwiseInverse().asDiagonal();
  const Eigen::MatrixXd left = b * (w + s * mass) * inverse * (w + s * mass);
  const Eigen::MatrixXd right = b * s * s * mass * coarse + 2.0 * b * s * d + b * w * inverse * d;
  return left.ldlt().solve(right);
}

Points dense_literal(const SurfaceOperators& operators, double a4, double a5, const Points& coarse,
                     const Points& d) {
  const Eigen::MatrixXd w = operators.laplacian, mass = unit_mass(operators).asDiagonal();
  const Eigen::MatrixXd left = w + a4 * mass + a5 * w.transpose() * mass * w;
  const Eigen::MatrixXd right = a4 * mass * coarse + a5 * w.transpose() * mass * d;
  return left.ldlt().solve(right);
}

class RecoveryZoo : public ::testing::TestWithParam<zoo::Entry> {
 protected:
  RecoveryZoo()
      : operators(operators_of(GetParam().mesh)),
        map(test::bent(operators.vertices)),
        jacobians(operators.jacobians_of(map)),
        size(test::diagonal(map)) {}

  SurfaceOperators operators;
  Points map;
  MatrixField jacobians;
  double size;
};

TEST_P(RecoveryZoo, ProductGivesBackAKnownMap) {
  for (const double pull : {1.0, 4000.0}) {
    const EmbeddingRecovery recovery(operators, {.pull = pull});
    EXPECT_LT(test::farthest(recovery.solve(map, jacobians), map), 1e-9 * size) << pull;
  }
}

TEST_P(RecoveryZoo, LiteralGivesBackAKnownMapOfPointsThatAnswerItsSmoothness) {
  const Points extra = operators.laplacian * map;
  const Points coarse =
      map + unit_mass(operators).cwiseInverse().asDiagonal() * extra / kLiteral.point_weight;
  const EmbeddingRecovery recovery(operators, kLiteral);
  EXPECT_LT(test::farthest(recovery.solve(coarse, jacobians), map), 1e-8 * size);
}

TEST_P(RecoveryZoo, SolvesTheEquationsAsPrinted) {
  const Points coarse = map + 0.05 * test::noise(map.rows(), 3, 1);
  const MatrixField other = jacobians + 0.1 * test::noise(jacobians.rows(), 9, 2);
  const Points d = operators.divergence_of(other);
  const Points product = EmbeddingRecovery(operators).solve(coarse, other);
  for (const double b : {6e-3, 1.0}) {
    const Points dense = dense_product(operators, 4000.0, b, coarse, d);
    EXPECT_LT(test::farthest(product, dense), 1e-7 * size) << b;
  }
  const Points literal = EmbeddingRecovery(operators, kLiteral).solve(coarse, other);
  EXPECT_LT(test::farthest(literal, dense_literal(operators, 2e4, 1.5e5, coarse, d)), 1e-7 * size);
}

TEST_P(RecoveryZoo, MovesWithThePoints) {
  const Points coarse = map + 0.05 * test::noise(map.rows(), 3, 1);
  const Eigen::RowVector3d by(3.0, -2.0, 0.5);
  for (const RecoveryOptions& options : {RecoveryOptions{}, kLiteral}) {
    const EmbeddingRecovery recovery(operators, options);
    const Points here = recovery.solve(coarse, jacobians);
    const Points there = recovery.solve(coarse.rowwise() + by, jacobians);
    // To the rounding of W, which slivers make large, times the move.
    EXPECT_LT(test::farthest(there, here.rowwise() + by), 1e-6 * size);
  }
}

TEST_P(RecoveryZoo, SharedAnalysisGivesTheSameBytes) {
  for (const RecoveryOptions& options : {RecoveryOptions{}, kLiteral}) {
    const auto shared = std::make_shared<const SymbolicCholesky>(
        EmbeddingRecovery::system(operators.laplacian, operators.mass, options));
    const Points own = EmbeddingRecovery(operators, options).solve(map, jacobians);
    EXPECT_EQ(EmbeddingRecovery(operators, options, shared).solve(map, jacobians), own);
  }
  const auto laplacian = std::make_shared<const SymbolicCholesky>(operators.laplacian);
  EXPECT_EQ(EmbeddingRecovery(operators, {}, laplacian).solve(map, jacobians),
            EmbeddingRecovery(operators).solve(map, jacobians));
}

SUPPLE_OVER_THE_ZOO(RecoveryZoo);

TEST(Recovery, TheUnitsAreTheCallers) {
  const zoo::Mesh mesh = zoo::perturbed_sphere(2, 7);
  const Points map = test::bent(mesh.vertices);
  for (const RecoveryOptions& options : {RecoveryOptions{}, kLiteral}) {
    const auto recovered = [&](double scale) -> Points {
      const SurfaceOperators operators(scale * mesh.vertices, mesh.faces,
                                       Eigen::VectorXi::Zero(mesh.vertices.rows()), 1);
      const Points coarse = scale * (map + 0.1 * test::noise(map.rows(), 3, 1));
      return EmbeddingRecovery(operators, options)
                 .solve(coarse, operators.jacobians_of(scale * map)) /
             scale;
    };
    EXPECT_LT(test::farthest(recovered(1.0), recovered(1000.0)), 1e-9);
  }
}

TEST(Recovery, ComponentsDoNotKnowOfEachOther) {
  const zoo::Mesh one = zoo::perturbed_sphere(2, 7);
  const SurfaceOperators operators =
      operators_of(zoo::joined(one, zoo::moved(zoo::torus(12, 8), {5, 0, 0})));
  const Points map = test::bent(operators.vertices);
  const MatrixField jacobians = operators.jacobians_of(map);
  Points moved = map;
  moved.topRows(one.vertices.rows()).rowwise() += Eigen::RowVector3d(0.3, 0.2, 0.1);
  const Eigen::Index rest = map.rows() - one.vertices.rows();
  for (const RecoveryOptions& options : {RecoveryOptions{}, kLiteral}) {
    const EmbeddingRecovery recovery(operators, options);
    const Points a = recovery.solve(map, jacobians), b = recovery.solve(moved, jacobians);
    EXPECT_LT(test::farthest(a.bottomRows(rest), b.bottomRows(rest)), 1e-12);
    EXPECT_LT(
        test::farthest(a.topRows(one.vertices.rows()).rowwise() + Eigen::RowVector3d(0.3, 0.2, 0.1),
                       b.topRows(one.vertices.rows())),
        1e-9);
  }
}

TEST(Recovery, TakesLargeShapesOfThePointsAndSmallOnesOfTheJacobians) {
  const SurfaceOperators operators = operators_of(zoo::icosphere(4));
  const MatrixField jacobians = operators.jacobians_of(operators.vertices);
  // Noise on the points, and all of them stretched: the noise goes, the stretch stays.
  const Points stretched = operators.vertices * Eigen::Vector3d(1.1, 1.0, 1.0).asDiagonal();
  const Points coarse = stretched + 0.01 * test::noise(stretched.rows(), 3, 1);
  const Points got = EmbeddingRecovery(operators).solve(coarse, jacobians);
  EXPECT_LT((got - stretched).norm(), 0.5 * (coarse - stretched).norm());
  EXPECT_LT((got - stretched).norm(), 0.5 * (operators.vertices - stretched).norm());
}

TEST(RecoveryErrors, Shapes) {
  const SurfaceOperators operators = operators_of(zoo::cube());
  const EmbeddingRecovery recovery(operators);
  const MatrixField jacobians = operators.jacobians_of(operators.vertices);
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"7 coarse points", "8 vertices"},
                               [&] { recovery.solve(Points::Zero(7, 3), jacobians); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"11 Jacobians", "12 faces"},
                               [&] { recovery.solve(operators.vertices, jacobians.topRows(11)); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"8 x 8", "7 vertices"}, [&] {
    EmbeddingRecovery(operators.laplacian, operators.mass.head(7), operators.divergence);
  }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"7 rows of the divergence"}, [&] {
    EmbeddingRecovery(operators.laplacian, operators.mass, operators.divergence.topRows(7));
  }));
  const auto other =
      std::make_shared<const SymbolicCholesky>(operators_of(zoo::tetrahedron()).laplacian);
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"8 rows", "share 4"},
                               [&] { EmbeddingRecovery(operators, {}, other); }));
}

TEST(RecoveryErrors, Options) {
  const SurfaceOperators operators = operators_of(zoo::cube());
  for (const double pull : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"pull", "positive"},
                                 [&] { EmbeddingRecovery(operators, {.pull = pull}); }));
  }
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"point weight"}, [&] {
    EmbeddingRecovery(operators, {.form = RecoveryForm::literal, .point_weight = 0.0});
  }));
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"Jacobian weight"}, [&] {
    EmbeddingRecovery(operators, {.form = RecoveryForm::literal, .jacobian_weight = -1.0});
  }));
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"'wide'", "product"},
                               [] { recovery_form("wide"); }));
  EXPECT_EQ(recovery_form(to_string(RecoveryForm::literal)), RecoveryForm::literal);
}

}  // namespace
}  // namespace supple
