// SPDX-License-Identifier: GPL-3.0-or-later
#include <string>

#include "supple/core/error.h"
#include "supple/geometry/tangent_gradient.h"
#include "supple/learning/diffusion_net.h"

namespace supple {

template <class Scalar>
DiffusionContext<Scalar>::DiffusionContext(const SurfaceOperators& operators,
                                           const Eigenbasis& basis, int eigenfunctions)
    : DiffusionContext(operators, basis, eigenfunctions, tangent_axes(operators.vertex_normals)) {}

template <class Scalar>
DiffusionContext<Scalar>::DiffusionContext(const SurfaceOperators& operators,
                                           const Eigenbasis& basis, int eigenfunctions,
                                           const Points& axes)
    : gradient(tangent_gradient(operators, axes).template cast<Scalar>()),
      gradient_transpose(gradient.transpose()) {
  if (eigenfunctions < 1) {
    throw Error(ErrorCode::bad_option, "Diffusion in " + std::to_string(eigenfunctions) +
                                           " eigenfunctions is not possible. Use 1 or more.");
  }
  if (basis.functions.rows() != operators.vertices.rows()) {
    throw Error(ErrorCode::wrong_shape,
                "The eigenfunctions are of " + std::to_string(basis.functions.rows()) +
                    " vertices, the surface has " + std::to_string(operators.vertices.rows()) +
                    ". Take both from one mesh.");
  }
  const Eigen::Index k = basis.stable_count(eigenfunctions);
  functions = basis.functions.leftCols(k).template cast<Scalar>();
  weighted = (basis.mass.asDiagonal() * basis.functions.leftCols(k)).template cast<Scalar>();
  values = basis.values.head(k).template cast<Scalar>();
}

template struct DiffusionContext<float>;
template struct DiffusionContext<double>;

}  // namespace supple
