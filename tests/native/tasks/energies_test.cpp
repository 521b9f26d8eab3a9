// SPDX-License-Identifier: GPL-3.0-or-later
#include "tasks/edit/energies.h"

#include <Eigen/Geometry>
#include <cmath>

#include "native/gradient_check.h"
#include "native/support.h"
#include "supple/geometry/jacobians.h"
#include "supple/tasks/metrics.h"

namespace supple {
namespace {

SurfaceOperators operators_of(const zoo::Mesh& mesh) {
  return SurfaceOperators(TriangleMesh(mesh.vertices, mesh.faces));
}

// Weight of ARAP in `StiffEnergy` where nothing has folded, from what it says of its stiffness.
double bending(const StiffEnergy& energy) { return 0.5 * (energy.stiffness() - 8.0); }

// Bent and roughened, no face anywhere near to collapsing.
Points deformed(const SurfaceOperators& operators) {
  return test::bent(operators.vertices) + 0.01 * test::noise(operators.vertices.rows(), 3, 8);
}

double value_of(const DeformationEnergy& energy, const Points& moved) {
  Points gradient;
  return energy.evaluate(moved, gradient);
}

Eigen::VectorXd area_ratios(const SurfaceOperators& operators, const Points& moved) {
  return face_areas(moved, operators.faces).cwiseQuotient(operators.face_areas);
}

// Steps of 1e-5 of the surface's size, well within the distance to where the tangent begins.
void expect_gradient(const DeformationEnergy& energy, const Points& moved) {
  constexpr double kUnit = 1e-2;
  Points gradient;
  energy.evaluate(moved, gradient);
  gradient *= kUnit;
  Points step = Points::Zero(moved.rows(), 3);
  EXPECT_TRUE(test::gradient_matches([&] { return value_of(energy, moved + kUnit * step); },
                                     test::values_of(step),
                                     test::values_of(std::as_const(gradient))));
}

std::vector<zoo::Mesh> small_meshes() {
  return {zoo::perturbed_sphere(1, 3), zoo::disc(3, 8), zoo::three_sheets(2), zoo::pinched_vertex(),
          zoo::joined(zoo::tetrahedron(), zoo::cube())};
}

TEST(ArapEnergy, GradientAgainstFiniteDifferences) {
  for (const zoo::Mesh& mesh : small_meshes()) {
    const SurfaceOperators operators = operators_of(mesh);
    expect_gradient(ArapEnergy(operators), deformed(operators));
  }
}

TEST(StiffEnergy, GradientAgainstFiniteDifferences) {
  for (const zoo::Mesh& mesh : small_meshes()) {
    const SurfaceOperators operators = operators_of(mesh);
    expect_gradient(StiffEnergy(operators), deformed(operators));
  }
}

TEST(StiffEnergy, GradientWhereFacesHaveNearlyNoArea) {
  for (const double squash : {0.05, 0.02}) {
    const SurfaceOperators operators = operators_of(zoo::perturbed_sphere(1, 3));
    Points moved = deformed(operators);
    moved.col(2) *= squash;
    const Eigen::VectorXd ratios = area_ratios(operators, moved);
    EXPECT_GE((ratios.array() < 0.09).count(), 4);
    EXPECT_GE((ratios.array() > 0.11).count(), 4);
    EXPECT_GT((ratios.array() - 0.1).abs().minCoeff(), 1e-4) << "a difference would cross the kink";
    expect_gradient(StiffEnergy(operators), moved);
  }
}

TEST(StiffEnergy, IsFiniteWhereEverythingHasCollapsed) {
  const SurfaceOperators operators = operators_of(zoo::perturbed_sphere(1, 3));
  const StiffEnergy energy(operators);
  Points line = operators.vertices;
  line.rightCols(2).setZero();
  for (const Points& moved : {Points(Points::Zero(line.rows(), 3)), line}) {
    Points gradient;
    EXPECT_TRUE(std::isfinite(energy.evaluate(moved, gradient)));
    EXPECT_TRUE(gradient.allFinite());
  }
}

class EnergyZoo : public ::testing::TestWithParam<zoo::Entry> {
 protected:
  void expect_none(const DeformationEnergy& energy, const Points& moved) const {
    Points gradient;
    // Terms of the size of the areas, sum 1, cancel.
    EXPECT_NEAR(energy.evaluate(moved, gradient), 0.0, 1e-11);
    // Jacobians are rounded to 1e-16 of the gradients of the hat functions that make them.
    const double steepest = operators.inverse_frames.cwiseAbs().maxCoeff();
    EXPECT_LT(gradient.norm(), 1e-13 * steepest * std::max(1.0, operators.laplacian.norm()));
  }
  SurfaceOperators operators = operators_of(GetParam().mesh);
};

TEST_P(EnergyZoo, OfARigidMotionIsNone) {
  for (uint64_t which = 0; which < 3; ++which) {
    const Points moved =
        (operators.vertices * test::rotation(which)).rowwise() + Eigen::RowVector3d(0.4, -1, 2);
    expect_none(ArapEnergy(operators), moved);
    expect_none(StiffEnergy(operators), moved);
  }
}

TEST_P(EnergyZoo, IsTheSameForATurnedDeformation) {
  const Points moved = deformed(operators);
  const Matrix3 turn = test::rotation(2);
  const auto expect_same = [&](const DeformationEnergy& energy) {
    Points gradient, turned;
    const double value = energy.evaluate(moved, gradient);
    EXPECT_NEAR(energy.evaluate(moved * turn, turned), value, 1e-9 * value);
    EXPECT_LT((turned - gradient * turn).norm(), 1e-7 * gradient.norm());
  };
  expect_same(ArapEnergy(operators));
  expect_same(StiffEnergy(operators));
}

TEST_P(EnergyZoo, WithoutBendingStiffIsSymmetricDirichlet) {
  const Points moved = deformed(operators);
  const Eigen::VectorXd ratios = area_ratios(operators, moved);
  if (ratios.minCoeff() < 0.1) {
    GTEST_SKIP() << "roughening has all but collapsed a face";
  }
  const double dirichlet = symmetric_dirichlet(operators.vertices, operators.faces, moved);
  const StiffEnergy energy(operators);
  const double got =
      value_of(energy, moved) - bending(energy) * value_of(ArapEnergy(operators), moved);
  EXPECT_NEAR(got, dirichlet, 1e-10 * dirichlet);
}

// Chao et al.'s formula: each vertex has all edges of its faces, each with half the cotangent of
// the face's own opposite angle.
double spokes_and_rims(const SurfaceOperators& operators, const Points& moved) {
  const Points& rest = operators.vertices;
  double energy = 0.0;
  for (int v = 0; v < rest.rows(); ++v) {
    struct Edge {
      Eigen::RowVector3d rest, moved;
      double weight;
    };
    std::vector<Edge> edges;
    for (Eigen::Index f = 0; f < operators.faces.rows(); ++f) {
      const Eigen::RowVector3i face = operators.faces.row(f);
      if ((face.array() != v).all()) {
        continue;
      }
      for (int c = 0; c < 3; ++c) {
        const int a = face[(c + 1) % 3], b = face[(c + 2) % 3];
        const Eigen::RowVector3d u = rest.row(a) - rest.row(face[c]),
                                 w = rest.row(b) - rest.row(face[c]);
        edges.push_back({rest.row(b) - rest.row(a), moved.row(b) - moved.row(a),
                         0.5 * u.dot(w) / u.cross(w).norm()});
      }
    }
    Matrix3 correlation = Matrix3::Zero();
    for (const Edge& e : edges) {
      correlation += e.weight * e.rest.transpose() * e.moved;
    }
    const Matrix3 turn = closest_rotation(correlation);
    for (const Edge& e : edges) {
      energy += e.weight * (e.moved - e.rest * turn).squaredNorm();
    }
  }
  return energy;
}

TEST_P(EnergyZoo, ArapIsSpokesAndRims) {
  // A |G|^2 = sum_e cot / 2 |e G|^2 over a face, so the edge form is three times the face form.
  for (const Points& moved : {deformed(operators), Points(operators.vertices * 1.3)}) {
    const double expected = spokes_and_rims(operators, moved);
    EXPECT_NEAR(3.0 * value_of(ArapEnergy(operators), moved), expected, 1e-9 * expected);
  }
}

SUPPLE_OVER_THE_ZOO(EnergyZoo);

TEST(StiffEnergy, OfAUniformScaleInClosedForm) {
  const SurfaceOperators operators = operators_of(zoo::icosphere(1));
  for (const double s : {0.5, 0.8, 2.0}) {
    const double dirichlet = 2.0 * s * s + 2.0 / (s * s) - 4.0;
    const double arap = 2.0 * (s - 1.0) * (s - 1.0) / 1.0;
    const StiffEnergy energy(operators);
    const Points scaled = s * operators.vertices;
    EXPECT_NEAR(
        value_of(energy, scaled) - bending(energy) * value_of(ArapEnergy(operators), scaled),
        dirichlet, 1e-12 * dirichlet);
    // Every vertex and face keeps its direction: |T - P R| = |s - 1| |P|.
    EXPECT_NEAR(value_of(ArapEnergy(operators), s * operators.vertices), arap, 1e-12);
  }
}

TEST(StiffEnergy, StiffensFoldsAndNothingElse) {
  const SurfaceOperators operators = operators_of(zoo::grid(6, 6, 1.0));
  StiffEnergy energy(operators);
  const Points bent = test::bent(operators.vertices);
  const double before = value_of(energy, bent);
  EXPECT_EQ(energy.stiffen_folds(bent), 0);
  EXPECT_EQ(value_of(energy, bent), before);

  // An inner vertex drawn over its neighbours turns faces over.
  Points folded = operators.vertices;
  const int inner = 3 * 7 + 3;
  folded.row(inner) += 2.5 * (folded.row(inner + 1) - folded.row(inner));
  const double arap = value_of(ArapEnergy(operators), folded), light = value_of(energy, folded);
  EXPECT_GT(energy.stiffen_folds(folded), 0);
  EXPECT_GT(value_of(energy, folded), light + 0.1 * arap);
  // Weights that differ from face to face leave it a gradient.
  expect_gradient(energy, deformed(operators));
}

TEST(StiffEnergy, WhatIsTurnedOverAtRestIsNoFold) {
  zoo::Mesh mesh = zoo::grid(6, 6, 1.0);
  const int inner = 3 * 7 + 3;
  mesh.vertices.row(inner) += 2.5 * (mesh.vertices.row(inner + 1) - mesh.vertices.row(inner));
  const SurfaceOperators operators = operators_of(mesh);
  StiffEnergy energy(operators);
  EXPECT_EQ(energy.stiffen_folds(operators.vertices), 0);
  EXPECT_EQ(energy.stiffen_folds(operators.vertices * test::rotation(1)), 0);
}

}  // namespace
}  // namespace supple
