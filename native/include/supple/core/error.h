// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <stdexcept>
#include <string>

namespace supple {

/// What went wrong, for programs; the message is for people.
enum class ErrorCode {
  empty_mesh,             ///< no faces, or none with an area
  wrong_shape,            ///< an array of the wrong size or dimension
  index_out_of_range,     ///< a face or a handle names a vertex that is not there
  not_finite,             ///< NaN or infinity in the input
  empty_handle,           ///< a handle without vertices
  overlapping_handles,    ///< a vertex in two handles
  no_handles,             ///< nothing holds or moves the mesh
  singular_matrix,        ///< a handle matrix without an inverse
  stale_mesh,             ///< the mesh is not the one that was prepared
  model_file,             ///< weights that are truncated, foreign or of another architecture
  array_file,             ///< arrays on disk that are damaged, foreign, or can't be read or written
  bad_option,             ///< a setting outside its range
  not_positive_definite,  ///< a factorisation met a matrix it cannot factor
  no_convergence,         ///< an iteration did not reach its stated residual
  cancelled,              ///< the caller asked for it
};

/// The code's name as written above.
const char* to_string(ErrorCode code);

/// Every failure of this library. The message names what is wrong, where, and the fix.
class Error : public std::runtime_error {
 public:
  Error(ErrorCode code, const std::string& message) : std::runtime_error(message), code_(code) {}
  ErrorCode code() const { return code_; }

 private:
  ErrorCode code_;
};

}  // namespace supple
