// SPDX-License-Identifier: GPL-3.0-or-later
// Forward and back substitution with a supernodal Cholesky factor, several right-hand sides a pass.
#pragma once

#include <cstddef>
#include <vector>

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
  const float* single_values = nullptr;  ///< the same, rounded; needed by panels of float alone
};

/// Panels as wide as this many right-hand sides are solved for: 4, 8, 16.
constexpr int kPanelWidths[] = {4, 8, 16};

/// Some supernodes [first, last).
struct SupernodeRange {
  int first, last;
};

/// Forward substitution L X = B over some supernodes, ascending. panel: n x width, row-major,
/// aligned to 64 bytes, in the factor's order, double or float; width: one of kPanelWidths. Each
/// entry of L is read once for all columns: one column at a time, the reading alone would take
/// longer.
template <class Scalar>
void forward_panel(const SupernodalFactor& factor, SupernodeRange range, Scalar* panel, int width);
/// Back substitution L^T X = B in the same way, descending.
template <class Scalar>
void backward_panel(const SupernodalFactor& factor, SupernodeRange range, Scalar* panel, int width);

/// The elimination tree cut into parts that do not touch each other and a top that all of them lead
/// to. Made once a factor, the same for any number of threads.
struct SupernodeParts {
  static constexpr int kParts = 4;
  std::vector<SupernodeRange> parts[kParts];  ///< subtrees, ascending; all empty for a small factor
  std::vector<SupernodeRange> top;            ///< ascending
  std::vector<int> top_rows;                  ///< rows of the top's supernodes, ascending
};
SupernodeParts supernode_parts(const SupernodalFactor& factor, int rows);

}  // namespace supple
