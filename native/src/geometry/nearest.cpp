// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/nearest.h"

#include <algorithm>
#include <array>
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
    // Equally near to rounding: the lowest index, so that a turned mesh gives the same answer. More
    // than a handful of ties does not happen on real meshes.
    constexpr size_t kCandidates = 8;
    std::array<size_t, kCandidates> index{};
    std::array<double, kCandidates> squared{};
    nanoflann::KNNResultSet<double> nearest(kCandidates);
    nearest.init(index.data(), squared.data());
    impl_->tree.findNeighbors(nearest, queries.row(i).data(), {});
    size_t best = index[0];
    for (size_t c = 1; c < nearest.size(); ++c) {
      if (squared[c] <= squared[0] * (1.0 + 1e-9) + 1e-18) {
        best = std::min(best, index[c]);
      }
    }
    result.squared_distance[i] = squared[0];
    result.index[i] = static_cast<int>(best);
  }
  return result;
}

}  // namespace supple
