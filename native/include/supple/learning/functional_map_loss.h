// SPDX-License-Identifier: GPL-3.0-or-later
// What a functional map is asked for where no true one is known. Each returns the term before
// weighting and, if `grad` is given, adds `weight` times its gradient (the shape of the map).
#pragma once

#include "supple/core/types.h"

namespace supple {

/// |C^T C - I|^2 of C (k_s x k_t): maps of equal areas are orthogonal. Source: the paper, Eqn 13.
/// Errors: `wrong_shape` for a gradient of another shape.
double orthogonality_loss(const RowMatrix<double>& map, double weight = 1.0,
                          RowMatrix<double>* grad = nullptr);

/// |C - C'|^2: C solved for from features beside C' of the soft map of the same features.
/// Source: the paper, Eqn 13. Errors: `wrong_shape`.
double coupling_loss(const RowMatrix<double>& map, const RowMatrix<double>& other,
                     double weight = 1.0, RowMatrix<double>* grad = nullptr,
                     RowMatrix<double>* grad_other = nullptr);

/// |C D - I|^2 of C (k_s x k_t) and D (k_t x k_s): there and back. Not in the paper's loss; in that
/// of Cao et al. 2023 (ULRSSM), for both orders. Errors: `wrong_shape`.
double bijectivity_loss(const RowMatrix<double>& map, const RowMatrix<double>& back,
                        double weight = 1.0, RowMatrix<double>* grad = nullptr,
                        RowMatrix<double>* grad_back = nullptr);

}  // namespace supple
