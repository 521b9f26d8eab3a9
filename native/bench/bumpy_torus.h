// SPDX-License-Identifier: GPL-3.0-or-later
// The surface that is measured on.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

#include "supple/core/types.h"

namespace supple::bench {

struct Shape {
  Points vertices;
  Faces faces;
};

/// A bumpy torus of about `count` vertices: curved, closed, without symmetry that a solver could
/// use, its vertices moved along it by up to a third of a cell, the same way every time.
inline Shape bumpy_torus(int count) {
  const int along = static_cast<int>(std::sqrt(count * 2.5)), around = count / along;
  Shape shape{Points(along * around, 3), Faces(2 * along * around, 3)};
  std::mt19937_64 random(1);
  const auto cell = [&](int i) {
    const double jitter = static_cast<double>(random() >> 11) * 0x1.0p-53 - 0.5;
    return 2.0 * std::numbers::pi * (i + 0.6 * jitter);
  };
  for (int i = 0; i < along; ++i) {
    for (int j = 0; j < around; ++j) {
      const double u = cell(i) / along, v = cell(j) / around;
      const double r = 0.3 * (1.0 + 0.2 * std::sin(3.0 * u + 0.3) * std::cos(2.0 * v));
      const double ring = 1.0 + r * std::cos(v);
      shape.vertices.row(i * around + j) << ring * std::cos(u), ring * std::sin(u), r * std::sin(v);
      const int a = i * around + j, b = ((i + 1) % along) * around + j;
      const int c = ((i + 1) % along) * around + (j + 1) % around,
                d = i * around + (j + 1) % around;
      shape.faces.row(2 * a) << a, b, c;
      shape.faces.row(2 * a + 1) << a, c, d;
    }
  }
  return shape;
}

}  // namespace supple::bench
