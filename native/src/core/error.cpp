// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/core/error.h"

namespace supple {

const char* to_string(ErrorCode code) {
  switch (code) {
    case ErrorCode::empty_mesh:
      return "empty_mesh";
    case ErrorCode::wrong_shape:
      return "wrong_shape";
    case ErrorCode::index_out_of_range:
      return "index_out_of_range";
    case ErrorCode::not_finite:
      return "not_finite";
    case ErrorCode::empty_handle:
      return "empty_handle";
    case ErrorCode::overlapping_handles:
      return "overlapping_handles";
    case ErrorCode::no_handles:
      return "no_handles";
    case ErrorCode::singular_matrix:
      return "singular_matrix";
    case ErrorCode::stale_mesh:
      return "stale_mesh";
    case ErrorCode::model_file:
      return "model_file";
    case ErrorCode::array_file:
      return "array_file";
    case ErrorCode::bad_option:
      return "bad_option";
    case ErrorCode::not_positive_definite:
      return "not_positive_definite";
    case ErrorCode::no_convergence:
      return "no_convergence";
    case ErrorCode::cancelled:
      return "cancelled";
  }
  return "unknown";
}

}  // namespace supple
