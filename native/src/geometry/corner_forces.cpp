// SPDX-License-Identifier: GPL-3.0-or-later
#include "corner_forces.h"

#include "core/prefetch.h"

namespace supple {

template <class Scalar>
CornerForces<Scalar>::CornerForces(const SurfaceOperators& operators)
    : operators_(operators),
      forces_(
          std::make_unique_for_overwrite<Force[]>(static_cast<size_t>(operators.faces.rows()))) {}

template <class Scalar>
Points CornerForces<Scalar>::gathered() const {
  const CornerTable& corners = operators_.corners;
  Points result(operators_.vertices.rows(), 3);
  const Eigen::Index n = result.rows();
#pragma omp parallel for schedule(static)
  for (Eigen::Index v = 0; v < n; ++v) {
    if (v + kAhead < n) {
      for (int i = corners.first[v + kAhead]; i < corners.first[v + kAhead + 1]; ++i) {
        prefetch(&forces_[static_cast<size_t>(corners.corner[i] / 3)], sizeof(Force));
      }
    }
    double sum[3] = {};
    for (int i = corners.first[v]; i < corners.first[v + 1]; ++i) {
      const int f = corners.corner[i] / 3, c = corners.corner[i] - 3 * f;
      const Force& force = forces_[static_cast<size_t>(f)];
      for (int j = 0; j < 3; ++j) {
        const double one = force.one[j], two = force.two[j];
        sum[j] += c == 0 ? -one - two : c == 1 ? one : two;
      }
    }
    result.row(v) = Eigen::Map<const Eigen::RowVector3d>(sum);
  }
  return result;
}

template class CornerForces<float>;
template class CornerForces<double>;

}  // namespace supple
