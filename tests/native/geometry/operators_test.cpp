// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/operators.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cmath>

#include "native/support.h"
#include "supple/geometry/surface_operators.h"

namespace supple {
namespace {

class OperatorsZoo : public ::testing::TestWithParam<zoo::Entry> {
 protected:
  OperatorsZoo() : mesh(GetParam().mesh.vertices, GetParam().mesh.faces), operators(mesh) {}
  double largest() const { return Eigen::MatrixXd(operators.laplacian).cwiseAbs().maxCoeff(); }

  TriangleMesh mesh;
  SurfaceOperators operators;
};

TEST_P(OperatorsZoo, LaplacianOfAConstantIsZero) {
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(operators.mass.size());
  EXPECT_LT((operators.laplacian * ones).cwiseAbs().maxCoeff(), 1e-14 * largest());
}

TEST_P(OperatorsZoo, LaplacianIsSymmetric) {
  const Eigen::MatrixXd dense = operators.laplacian;
  EXPECT_EQ((dense - dense.transpose()).cwiseAbs().maxCoeff(), 0.0);
}

TEST_P(OperatorsZoo, LaplacianIsPositiveSemidefinite) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver{Eigen::MatrixXd(operators.laplacian)};
  EXPECT_GT(solver.eigenvalues().minCoeff(), -1e-12 * solver.eigenvalues().maxCoeff());
  // Its kernel is exactly one constant a component.
  const int components = GetParam().components;
  EXPECT_LT(solver.eigenvalues()[components - 1], 1e-12 * solver.eigenvalues().maxCoeff());
  EXPECT_GT(solver.eigenvalues()[components], 1e-9 * solver.eigenvalues().maxCoeff());
}

TEST_P(OperatorsZoo, LaplacianIsDivergenceOfGradient) {
  const SparseMatrix g = gradient(operators.vertices, operators.faces);
  const SparseMatrix composed = divergence(g, operators.face_areas) * g;
  const Eigen::MatrixXd difference =
      Eigen::MatrixXd(composed) - Eigen::MatrixXd(operators.laplacian);
  EXPECT_LT(difference.cwiseAbs().maxCoeff(), 1e-11 * largest());
}

TEST_P(OperatorsZoo, MassIsPositiveAndSumsToTheArea) {
  EXPECT_GT(operators.mass.minCoeff(), 0.0);
  EXPECT_NEAR(operators.mass.sum(), operators.face_areas.sum(), 1e-12);
}

TEST_P(OperatorsZoo, GradientOfALinearFunctionIsItsTangentPart) {
  const Eigen::RowVector3d slope(0.3, -1.7, 0.8);
  const Eigen::VectorXd u = (operators.vertices * slope.transpose()).array() + 4.0;
  const Eigen::VectorXd field = gradient(operators.vertices, operators.faces) * u;
  for (Eigen::Index f = 0; f < operators.faces.rows(); ++f) {
    const Eigen::RowVector3d normal = operators.face_normals.row(f);
    const Eigen::RowVector3d expected = slope - slope.dot(normal) * normal;
    const Eigen::RowVector3d got = field.segment<3>(3 * f).transpose();
    // A thin face divides rounding by its height.
    const double height = operators.face_areas[f] / std::sqrt(operators.face_areas.maxCoeff());
    EXPECT_LT((got - expected).norm(), 1e-13 / height) << "face " << f;
  }
}

TEST_P(OperatorsZoo, JacobiansOfTheRestMeshAreTheIdentity) {
  const MatrixField field = operators.jacobians_of(operators.vertices);
  const Matrix3 identity = Matrix3::Identity();
  for (Eigen::Index f = 0; f < field.rows(); ++f) {
    EXPECT_LT((matrix_at(field, f) - identity).cwiseAbs().maxCoeff(), 1e-11) << "face " << f;
  }
}

TEST_P(OperatorsZoo, PoissonsRightHandSideIsTheLaplacianOfTheMap) {
  const Points target = test::bent(operators.vertices);
  const Points expected = operators.laplacian * target;
  const Points got = operators.divergence_of(operators.jacobians_of(target));
  EXPECT_LT((got - expected).cwiseAbs().maxCoeff(), 1e-11 * largest());
}

TEST_P(OperatorsZoo, DivergenceOfAFieldIsTheSparseOperatorTimesIt) {
  const MatrixField field = test::noise(operators.faces.rows(), 9, 3);
  const Points expected = operators.divergence * stacked(field);
  // Relative to what cancels in the sums; slivers' gradients, found in two ways, lose a digit.
  const double size = (operators.divergence.cwiseAbs() * stacked(field).cwiseAbs()).norm();
  EXPECT_LT((operators.divergence_of(field) - expected).norm(), 1e-13 * size);
}

TEST_P(OperatorsZoo, DivergenceBackwardIsItsTranspose) {
  MatrixField x(operators.faces.rows(), 9);
  x = test::noise(x.rows(), 9, 1);
  const Points y = test::noise(operators.vertices.rows(), 3, 2);
  const double forward = operators.divergence_of(x).cwiseProduct(y).sum();
  const double backward = x.cwiseProduct(operators.divergence_backward(y)).sum();
  EXPECT_NEAR(forward, backward, 1e-12 * std::max(1.0, std::abs(forward)));
}

SUPPLE_OVER_THE_ZOO(OperatorsZoo);

// One triangle with a right angle at vertex 0: cotangents 0, 1/2 (at 1), 2 (at 2), area 1.
zoo::Mesh right_triangle() {
  zoo::Mesh mesh;
  mesh.vertices = (Points(3, 3) << 0, 0, 0, 2, 0, 0, 0, 1, 0).finished();
  mesh.faces = (Faces(1, 3) << 0, 1, 2).finished();
  return mesh;
}

TEST(CotanLaplacian, RightTriangleByHand) {
  const zoo::Mesh mesh = right_triangle();
  // Edge weights are half the opposite cotangent: w12 = 0, w02 = cot(1) / 2 = 1, w01 = cot(2) / 2 =
  // 1/4.
  Eigen::Matrix3d expected;
  expected << 1.25, -0.25, -1.0, -0.25, 0.25, 0.0, -1.0, 0.0, 1.0;
  const Eigen::MatrixXd got = cotan_laplacian(mesh.vertices, mesh.faces);
  EXPECT_LT((got - expected).cwiseAbs().maxCoeff(), 1e-15) << got;
}

TEST(CotanLaplacian, DoesNotDependOnScaleOrPlace) {
  const zoo::Mesh mesh = zoo::perturbed_sphere(1, 2);
  const zoo::Mesh other = zoo::moved(mesh, {1, -2, 3}, 250.0);
  const Eigen::MatrixXd a = cotan_laplacian(mesh.vertices, mesh.faces);
  const Eigen::MatrixXd b = cotan_laplacian(other.vertices, other.faces);
  EXPECT_LT((a - b).cwiseAbs().maxCoeff(), 1e-10);
}

TEST(LumpedMass, RightTriangleByHand) {
  // Meyer et al.: the circumcentre is the middle of the hypotenuse, so the corner with the right
  // angle gets half, the others a quarter each.
  const zoo::Mesh mesh = right_triangle();
  const Eigen::VectorXd mass = lumped_mass(mesh.vertices, mesh.faces);
  EXPECT_NEAR(mass[0], 0.5, 1e-15);
  EXPECT_NEAR(mass[1], 0.25, 1e-15);
  EXPECT_NEAR(mass[2], 0.25, 1e-15);
}

TEST(LumpedMass, AcuteTriangleByHand) {
  // Base 2, height 2: cot at the base corners is 1/2, at the top 3/4. Voronoi areas
  // (|e|^2 cot + |e'|^2 cot') / 8: top 2 * 5 * 0.5 / 8 = 5/8, base (4 * 0.75 + 5 * 0.5) / 8 =
  // 11/16.
  zoo::Mesh mesh;
  mesh.vertices = (Points(3, 3) << -1, 0, 0, 1, 0, 0, 0, 2, 0).finished();
  mesh.faces = (Faces(1, 3) << 0, 1, 2).finished();
  const Eigen::VectorXd mass = lumped_mass(mesh.vertices, mesh.faces);
  EXPECT_NEAR(mass[0], 11.0 / 16.0, 1e-15);
  EXPECT_NEAR(mass[1], 11.0 / 16.0, 1e-15);
  EXPECT_NEAR(mass[2], 5.0 / 8.0, 1e-15);
}

TEST(LumpedMass, ObtuseTriangleByHand) {
  // Base 4, height 1, obtuse at the top: half of the area 2 there, a quarter at the others.
  zoo::Mesh mesh;
  mesh.vertices = (Points(3, 3) << -2, 0, 0, 2, 0, 0, 0, 1, 0).finished();
  for (int turn = 0; turn < 3; ++turn) {
    mesh.faces.resize(1, 3);
    for (int c = 0; c < 3; ++c) {
      mesh.faces(0, c) = (c + turn) % 3;
    }
    const Eigen::VectorXd mass = lumped_mass(mesh.vertices, mesh.faces);
    EXPECT_NEAR(mass[0], 0.5, 1e-15);
    EXPECT_NEAR(mass[1], 0.5, 1e-15);
    EXPECT_NEAR(mass[2], 1.0, 1e-15);
  }
}

TEST(VertexNormals, OfASpherePointOutwards) {
  const zoo::Mesh mesh = zoo::icosphere(3);
  const Points normals = vertex_normals(mesh.vertices, mesh.faces);
  EXPECT_GT(normals.cwiseProduct(mesh.vertices).rowwise().sum().minCoeff(), 0.999);
  EXPECT_LT((normals.rowwise().norm().array() - 1.0).abs().maxCoeff(), 1e-14);
}

TEST(VertexNormals, AreZeroWhereTheyCancel) {
  zoo::Mesh mesh = right_triangle();
  mesh.faces = (Faces(2, 3) << 0, 1, 2, 0, 2, 1).finished();
  EXPECT_TRUE(vertex_normals(mesh.vertices, mesh.faces).isZero(0.0));
}

}  // namespace
}  // namespace supple
