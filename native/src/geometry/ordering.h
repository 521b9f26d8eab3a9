// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "supple/core/types.h"

namespace supple {

/// Whether an ordering names each of n rows once.
bool is_ordering(const Eigen::VectorXi& ordering, Eigen::Index n);

}  // namespace supple
