// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace supple {

/// Threads that a call from this thread shares its work among, BLAS included. Starts as
/// OMP_NUM_THREADS or the number of processors; each thread of the caller's has its own setting.
int thread_count();
/// count >= 1. Errors: `bad_option`.
void set_thread_count(int count);

}  // namespace supple
