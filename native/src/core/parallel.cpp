// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/core/parallel.h"

#include <omp.h>

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

}  // namespace supple
