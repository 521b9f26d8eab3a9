// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/nearest.h"

#include <nanoflann.hpp>

namespace supple {

struct NearestPoints::Impl {
  explicit Impl(Points p) : points(std::move(p)), tree(3, *this) {}

  // What nanoflann asks of a point cloud.
  size_t kdtree_get_point_count() const { return static_cast<size_t>(points.rows()); }
  double kdtree_get_pt(size_t i, size_t d) const {
    return points(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(d));
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }

  Points points;
  nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Impl>, Impl, 3> tree;
};

NearestPoints::NearestPoints(Points points) : impl_(std::make_unique<Impl>(std::move(points))) {}
NearestPoints::~NearestPoints() = default;

NearestPoints::Result NearestPoints::query(const Points& queries) const {
  Result result{Eigen::VectorXi(queries.rows()), Eigen::VectorXd(queries.rows())};
#pragma omp parallel for schedule(static)
  for (Eigen::Index i = 0; i < queries.rows(); ++i) {
    size_t index = 0;
    nanoflann::KNNResultSet<double> nearest(1);
    nearest.init(&index, &result.squared_distance[i]);
    impl_->tree.findNeighbors(nearest, queries.row(i).data(), {});
    result.index[i] = static_cast<int>(index);
  }
  return result;
}

}  // namespace supple
