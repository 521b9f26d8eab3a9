// SPDX-License-Identifier: GPL-3.0-or-later
// A file of named arrays that is verified whole when it is read: for what can be computed again.
//
//   8 bytes        "SUPPLEAF"
//   u32, u32       version of this format, number of arrays
//   u64            size of the file
//   32 bytes       key, padded with zeros
//   64 each        name (32 bytes, padded with zeros), type u32, 0 u32, rows i64, cols i64, XXH3-64
//                  of the data
//   u64            XXH3-64 of all before it
//   the arrays     one after the other, row by row
//
// Numbers are little-endian. No byte is outside a checksum.
#pragma once

#include <concepts>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>

#include "supple/core/types.h"

namespace supple {

enum class ArrayType : uint32_t { float64 = 1, float32 = 2, int32 = 3 };

/// A matrix or vector in memory by name: written to a file, or filled from one.
struct NamedArray {
  /// name: at most 32 bytes. matrix: dense, row-major or a vector, of double, float or int; not
  /// owned, must outlive this. What is written is its shape and memory of now.
  template <class Matrix>
  NamedArray(std::string name, Matrix& matrix);

  std::string name;
  ArrayType type;
  Eigen::Index rows, cols;
  const void* data;
  /// Gives the matrix this shape and returns where its values go; nullptr if it can't have it.
  std::function<void*(Eigen::Index rows, Eigen::Index cols)> reshape;
};

/// Size in bytes of a file of these arrays.
int64_t array_file_size(std::span<const NamedArray> arrays);

/// Writes a new file and has the system bring it to the disk. key: at most 32 bytes.
/// Errors: `array_file` where it exists already or can't be written whole; it is then removed.
void write_array_file(const std::filesystem::path& path, const std::string& key,
                      std::span<const NamedArray> arrays);

/// Fills the arrays, which must be those that were written, in their order; false where there is no
/// such file. Reads any bytes without harm, and allocates no more than the file's size.
/// Errors: `array_file` where it can't be read or anything in it is not as it was written; what the
/// arrays hold is then undefined.
bool read_array_file(const std::filesystem::path& path, const std::string& key,
                     std::span<const NamedArray> arrays);

// ------------------------------------------------------------------------------------------------

template <class Matrix>
NamedArray::NamedArray(std::string name_in, Matrix& matrix)
    : name(std::move(name_in)), rows(matrix.rows()), cols(matrix.cols()), data(matrix.data()) {
  using Scalar = typename Matrix::Scalar;
  static_assert(Matrix::IsRowMajor || Matrix::IsVectorAtCompileTime, "rows are written");
  static_assert(std::is_same_v<Scalar, double> || std::is_same_v<Scalar, float> ||
                std::is_same_v<Scalar, int>);
  type = std::is_same_v<Scalar, double>  ? ArrayType::float64
         : std::is_same_v<Scalar, float> ? ArrayType::float32
                                         : ArrayType::int32;
  reshape = [&matrix](Eigen::Index r, Eigen::Index c) -> void* {
    const auto fits = [](Eigen::Index size, int fixed) {
      return fixed == Eigen::Dynamic || size == fixed;
    };
    if (!fits(r, Matrix::RowsAtCompileTime) || !fits(c, Matrix::ColsAtCompileTime)) {
      return nullptr;
    }
    matrix.resize(r, c);
    return matrix.data();
  };
}

}  // namespace supple
