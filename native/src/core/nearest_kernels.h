// SPDX-License-Identifier: GPL-3.0-or-later
// The kernels of `nearest_rows`: tiles of queries against tiles of points, in single precision.
#pragma once

#include "supple/core/types.h"

namespace supple {

// One tile of queries against one of points. The score of a point y for a query x is
// x . y - |y|^2 / 2, the larger the nearer.
struct Pairing {
  const float* queries;  // numbers x the kernel's width
  const float* points;   // numbers x the kernel's height
  const float* offsets;  // height: -|y|^2 / 2
  Eigen::Index numbers;
  // The scores of the first so many numbers alone come first, with `first_offsets` (height);
  // where they are less than `enough` (width) for all pairs, they are all. 0: all at once.
  Eigen::Index first;
  const float* first_offsets;
  const float* enough;
  float* scores;  // height x width
  float* best;    // width: the best score of each query in this tile
};

// How far queries are from the tiles' middles, and how far from a query its nearest point may be.
struct Reach {
  const float* away;         // tiles x width: square of the distance to the middle
  const float* far;          // width
  const float* far_squares;  // width
  const float* radii;        // tiles
  Eigen::Index tiles;
  unsigned char* within;  // tiles: whether one may hold the nearest point of a query
};

struct NearestKernel {
  bool (*score)(const Pairing&);
  void (*reach)(const Reach&);
  Eigen::Index width, height;  // queries and points at a time
};
/// The best for this machine.
NearestKernel nearest_kernel();

}  // namespace supple
