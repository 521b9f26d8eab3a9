// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/tangent_gradient.h"

#include <Eigen/Geometry>
#include <cmath>

#include "native/support.h"

namespace supple {
namespace {

SurfaceOperators operators_of(const zoo::Mesh& mesh) {
  return SurfaceOperators(TriangleMesh(mesh.vertices, mesh.faces));
}

// n x 3 vectors of 2n components in the frames of `axes`.
Points in_space(const SurfaceOperators& operators, const Points& axes,
                const Eigen::VectorXd& components) {
  const Eigen::Index n = axes.rows();
  Points result(n, 3);
  for (Eigen::Index v = 0; v < n; ++v) {
    const Eigen::RowVector3d second = operators.vertex_normals.row(v).cross(axes.row(v));
    result.row(v) = components[v] * axes.row(v) + components[n + v] * second;
  }
  return result;
}

TEST(TangentGradient, IsExactForLinearFunctionsOfThePlane) {
  zoo::Mesh mesh = zoo::grid(7, 5, 0.3);
  const Matrix3 turn = test::rotation(1);
  mesh.vertices *= turn;
  const SurfaceOperators operators = operators_of(mesh);
  const Points axes = tangent_axes(operators.vertex_normals);
  const Eigen::RowVector3d slope = Eigen::RowVector3d(0.7, -1.9, 0.0) * turn;
  const Eigen::VectorXd function = operators.vertices * slope.transpose();
  const Points found = in_space(operators, axes, tangent_gradient(operators, axes) * function);
  EXPECT_LT(test::farthest(found, slope.replicate(found.rows(), 1)), 1e-12);
}

TEST(TangentGradient, ConstantsHaveNone) {
  for (const zoo::Entry& entry : zoo::all()) {
    const SurfaceOperators operators = operators_of(entry.mesh);
    const SparseRowMatrix gradient =
        tangent_gradient(operators, tangent_axes(operators.vertex_normals));
    const Eigen::VectorXd ones = Eigen::VectorXd::Ones(operators.vertices.rows());
    const double size = (gradient.cwiseAbs() * ones).cwiseAbs().maxCoeff();
    EXPECT_LT((gradient * ones).cwiseAbs().maxCoeff(), 1e-12 * size + 1e-12) << entry.name;
  }
}

TEST(TangentGradient, TendsToTheSpheres) {
  // Of the height z on the unit sphere: the upward direction less its part along the normal.
  double before = 0.0;
  for (int levels = 2; levels <= 4; ++levels) {
    const zoo::Mesh mesh = zoo::icosphere(levels);
    const SurfaceOperators operators = operators_of(mesh);
    const Points axes = tangent_axes(operators.vertex_normals);
    const double radius = operators.vertices.row(0).norm();
    const Points found =
        in_space(operators, axes, tangent_gradient(operators, axes) * operators.vertices.col(2));
    Points exact(found.rows(), 3);
    for (Eigen::Index v = 0; v < exact.rows(); ++v) {
      const Eigen::RowVector3d normal = operators.vertices.row(v) / radius;
      exact.row(v) = Eigen::RowVector3d::UnitZ() - normal[2] * normal;
    }
    const double error = test::farthest(found, exact);
    if (levels > 2) {
      EXPECT_LT(error, 0.6 * before);
    }
    before = error;
  }
  EXPECT_LT(before, 0.02);
}

TEST(TangentGradient, TurnsWithItsAxes) {
  const SurfaceOperators operators = operators_of(zoo::perturbed_sphere(2, 3));
  const Points axes = tangent_axes(operators.vertex_normals);
  Points turned(axes.rows(), 3);
  for (Eigen::Index v = 0; v < axes.rows(); ++v) {
    const Eigen::Vector3d normal = operators.vertex_normals.row(v);
    turned.row(v) =
        Eigen::AngleAxisd(0.1 + 0.3 * static_cast<double>(v), normal) * axes.row(v).transpose();
  }
  const Eigen::VectorXd function = test::noise(axes.rows(), 1, 1);
  const Points a = in_space(operators, axes, tangent_gradient(operators, axes) * function);
  const Points b = in_space(operators, turned, tangent_gradient(operators, turned) * function);
  EXPECT_LT((a - b).norm(), 1e-12 * a.norm());
}

TEST(TangentAxes, AreUnitAndTangent) {
  const SurfaceOperators operators = operators_of(zoo::perturbed_sphere(2, 3));
  const Points axes = tangent_axes(operators.vertex_normals);
  for (Eigen::Index v = 0; v < axes.rows(); ++v) {
    EXPECT_NEAR(axes.row(v).norm(), 1.0, 1e-12);
    EXPECT_NEAR(axes.row(v).dot(operators.vertex_normals.row(v)), 0.0, 1e-12);
  }
  EXPECT_TRUE(tangent_axes(Points::Zero(2, 3)).isZero(0.0));
}

TEST(TangentGradient, AxesOfAnotherSurface) {
  const SurfaceOperators operators = operators_of(zoo::cube());
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"3 tangent axes", "8 vertices"},
                               [&] { tangent_gradient(operators, Points::Zero(3, 3)); }));
}

}  // namespace
}  // namespace supple
