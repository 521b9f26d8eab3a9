// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/core/parallel.h"

#include <omp.h>

#include <atomic>
#include <exception>
#include <mutex>
#include <string>

#include "supple/core/error.h"

namespace supple {

int thread_count() { return omp_get_max_threads(); }

void set_thread_count(int count) {
  if (count < 1) {
    throw Error(ErrorCode::bad_option,
                "The number of threads is " + std::to_string(count) + "; it must be 1 or more.");
  }
  omp_set_num_threads(count);  // OpenBLAS, being the OpenMP build, asks for the same number
}

void run_at_once(size_t count, const std::function<void(size_t)>& step) {
  std::exception_ptr failure;
  std::mutex mutex;
  std::atomic<bool> failed = false;
#pragma omp parallel for schedule(dynamic, 1) if (count > 1)
  for (size_t i = 0; i < count; ++i) {
    if (failed) {
      continue;
    }
    try {
      const SingleThread one;
      step(i);
    } catch (...) {
      const std::lock_guard lock(mutex);
      if (!failed) {
        failure = std::current_exception();
        failed = true;
      }
    }
  }
  if (failure) {
    std::rethrow_exception(failure);
  }
}

}  // namespace supple
