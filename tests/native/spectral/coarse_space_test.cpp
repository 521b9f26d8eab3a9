// SPDX-License-Identifier: GPL-3.0-or-later
#include "spectral/coarse_space.h"

#include <Eigen/Eigenvalues>
#include <algorithm>

#include "native/support.h"
#include "supple/geometry/operators.h"
#include "supple/geometry/surface_operators.h"
#include "supple/spectral/eigenbasis.h"

namespace supple {
namespace {

class CoarseSpaceZoo : public ::testing::TestWithParam<zoo::Entry> {};

// What holds on any surface: constants, components and the area are kept.
TEST_P(CoarseSpaceZoo, KeepsConstantsAndTheArea) {
  const SurfaceOperators operators{TriangleMesh(GetParam().mesh.vertices, GetParam().mesh.faces)};
  const SparseMatrix& laplacian = operators.laplacian;
  const Eigen::VectorXd& mass = operators.mass;
  for (const int rings : {1, 2}) {
    const CoarseSpace space = coarse_space(laplacian, mass, rings);
    const Eigen::Index c = space.mass.size();
    ASSERT_EQ(space.prolongation.rows(), mass.size());
    ASSERT_EQ(space.prolongation.cols(), c);
    ASSERT_EQ(space.laplacian.rows(), c);
    EXPECT_GE(c, 1);
    EXPECT_LE(c, mass.size());
    EXPECT_GT(space.mass.minCoeff(), 0.0);
    const Eigen::VectorXd ones = Eigen::VectorXd::Ones(c);
    EXPECT_LT(
        (space.prolongation * ones - Eigen::VectorXd::Ones(mass.size())).cwiseAbs().maxCoeff(),
        1e-12);
    EXPECT_NEAR(space.mass.sum(), mass.sum(), 1e-3 * mass.sum());
    const double size = std::max(1.0, SparseMatrix(laplacian.cwiseAbs()).sum());
    EXPECT_LT((space.laplacian * ones).cwiseAbs().maxCoeff(), 1e-10 * size);
    const Eigen::MatrixXd dense = space.laplacian;
    EXPECT_LT((dense - dense.transpose()).cwiseAbs().maxCoeff(), 1e-10 * size);
  }
}

SUPPLE_OVER_THE_ZOO(CoarseSpaceZoo);

// Linear functions are near it: eigenvalues within some percent, where plain smoothed aggregation
// is off by 70%.
TEST(CoarseSpace, HasNearlyTheEigenvaluesOfTheMesh) {
  for (const zoo::Mesh& mesh : {zoo::perturbed_sphere(5, 7), zoo::grid(60, 50, 0.04)}) {
    const SparseMatrix laplacian = cotan_laplacian(mesh.vertices, mesh.faces);
    const Eigen::VectorXd mass = lumped_mass(mesh.vertices, mesh.faces);
    const Eigenbasis exact = eigenbasis(laplacian, mass, {.count = 8});
    for (const int rings : {1, 2}) {
      const CoarseSpace space = coarse_space(laplacian, mass, rings);
      EXPECT_LT(space.mass.size() * (rings == 1 ? 5 : 12), mass.size());
      const Eigen::MatrixXd w = space.laplacian, m = space.mass.asDiagonal();
      const Eigen::VectorXd values =
          Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd>(w, m, Eigen::EigenvaluesOnly)
              .eigenvalues();
      for (Eigen::Index k = 1; k < 8; ++k) {
        EXPECT_NEAR(values[k], exact.values[k], 0.1 * exact.values[k])
            << mass.size() << " vertices, " << rings << " rings, value " << k;
      }
    }
  }
}

}  // namespace
}  // namespace supple
