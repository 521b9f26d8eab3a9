// SPDX-License-Identifier: GPL-3.0-or-later
// Forward and back substitution with a supernodal Cholesky factor, several right-hand sides a pass.
#pragma once

#include <cstddef>

#include "factor.h"

namespace supple {

/// L of A = L L^T as CHOLMOD lays it out. Supernode s has columns super[s]..super[s+1]-1; the rows
/// of its dense block are rows[row_start[s]]..; the block is column-major from
/// values[value_start[s]], its top square lower triangular.
struct SupernodalFactor {
  int supernodes = 0;
  const int* super = nullptr;
  const int* row_start = nullptr;
  const int* value_start = nullptr;
  const int* rows = nullptr;
  const double* values = nullptr;
};

/// Panels as wide as this many right-hand sides are solved for: 4, 8, 16.
constexpr int kPanelWidths[] = {4, 8, 16};

/// Solves L L^T X = B in place, or L X = B or L^T X = B alone. panel: n x width, row-major, aligned
/// to 64 bytes, in the factor's order; width: one of kPanelWidths. Each entry of L is read twice,
/// for 2 * width products each: one column at a time, the reading alone would take longer.
void solve_panel(const SupernodalFactor& factor, double* panel, int width, Substitution part);

}  // namespace supple
