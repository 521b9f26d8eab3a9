// SPDX-License-Identifier: GPL-3.0-or-later
// What each vertex contributes to the Jacobians of its faces (`Combination`), as many vertices at a
// time as a vector has lanes.
#pragma once

#include "equivariant_parts.h"

namespace supple::equivariant {

template <class Scalar>
class CombineKernel {
 public:
  /// outputs: k x output_count coefficients. context: must outlive this.
  CombineKernel(const NetworkContext<Scalar>& context, const Fields<Scalar>& fields,
                const RowMatrix<Scalar>& outputs);

  /// Writes out[first..last - 1] of the n vertices; of different ones from several threads.
  void combine(Eigen::Index first, Eigen::Index last, Combination<Scalar>* out) const;

 private:
  const NetworkContext<Scalar>& context_;
  Layout layout_;
  RowMatrix<Scalar> coefficients_;   // k x columns: 9 a field, then the outputs'; the rest 0
  Scalar reference_[9], defect_[9];  // C, C C^T - I
};

}  // namespace supple::equivariant
