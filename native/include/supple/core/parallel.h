// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <functional>

namespace supple {

/// Threads that a call from this thread shares its work among, BLAS included. Starts as
/// OMP_NUM_THREADS or the number of processors; each thread of the caller's has its own setting.
int thread_count();
/// count >= 1. Errors: `bad_option`.
void set_thread_count(int count);

/// One thread while it lives, for many small steps: waking another takes longer than such a step.
class SingleThread {
 public:
  SingleThread() : before_(thread_count()) { set_thread_count(1); }
  ~SingleThread() { set_thread_count(before_); }
  SingleThread(const SingleThread&) = delete;
  SingleThread& operator=(const SingleThread&) = delete;

 private:
  int before_;
};

/// Calls step(i) for each i below count, as many at a time as there are threads, each with one
/// thread of its own. After a step has thrown no other begins, and the first exception is thrown
/// on.
void run_at_once(size_t count, const std::function<void(size_t)>& step);

}  // namespace supple
