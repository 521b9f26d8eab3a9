// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "supple/tasks/edit.h"

namespace supple {

/// Errors as `Editor`'s constructor states; vertex_count is the mesh's.
void check_handles(const std::vector<Handle>& handles, Eigen::Index vertex_count);

/// Errors as `Editor::solve` states.
void check_targets(const std::vector<Handle>& handles, const std::vector<HandleTarget>& targets);

}  // namespace supple
