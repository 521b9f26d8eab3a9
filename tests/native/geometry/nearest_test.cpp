// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/nearest.h"

#include "native/support.h"

namespace supple {
namespace {

TEST(NearestPoints, AgreesWithTryingThemAll) {
  const Points points = test::noise(300, 3, 1), queries = test::noise(100, 3, 2);
  const NearestPoints::Result result = NearestPoints(points).query(queries);
  for (Eigen::Index i = 0; i < queries.rows(); ++i) {
    const Eigen::RowVector3d q = queries.row(i);
    Eigen::Index best = 0;
    const double distance = (points.rowwise() - q).rowwise().squaredNorm().minCoeff(&best);
    EXPECT_EQ(result.index[i], best);
    EXPECT_NEAR(result.squared_distance[i], distance, 1e-14);
  }
}

TEST(NearestPoints, OnePointAndNoQueries) {
  const NearestPoints one(Points::Ones(1, 3));
  EXPECT_EQ(one.query(Points::Zero(4, 3)).index, Eigen::VectorXi::Zero(4));
  EXPECT_EQ(one.query(Points(0, 3)).index.size(), 0);
}

}  // namespace
}  // namespace supple
