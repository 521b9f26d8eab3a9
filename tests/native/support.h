// SPDX-License-Identifier: GPL-3.0-or-later
// Small things most tests need.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <functional>
#include <string>

#include "native/zoo.h"
#include "supple/core/error.h"
#include "supple/core/types.h"

namespace supple {

// Parameterised tests show the entry's name instead of its bytes.
namespace zoo {
inline void PrintTo(const Entry& entry, std::ostream* out) { *out << entry.name; }
}  // namespace zoo

namespace test {

/// rows x cols numbers in [-1, 1), the same on every platform.
RowMatrix<double> noise(Eigen::Index rows, Eigen::Index cols, uint64_t seed);

/// A rotation that leaves no axis alone; `which` picks one of many.
Matrix3 rotation(uint64_t which);

/// A smooth deformation that bends, twists and stretches: n x 3 to n x 3. It works in units of the
/// points' own bounding box.
Points bent(const Points& points);

/// Diagonal of the bounding box.
double diagonal(const Points& points);

/// Largest distance between rows of the same index.
double farthest(const Points& a, const Points& b);

/// Passes where `call` throws `Error` with this code and a message that contains every part.
::testing::AssertionResult fails_with(ErrorCode code, std::initializer_list<const char*> parts,
                                      const std::function<void()>& call);

/// Runs `check` once for each instruction set that has kernels of its own, each in a new process
/// that reads SUPPLE_SIMD afresh; sets this machine lacks are left out. Fails where a `check` does.
void at_every_simd_level(const std::function<void()>& check);

/// OpenMP's number of threads for a scope.
class Threads {
 public:
  explicit Threads(int count);
  ~Threads();
  Threads(const Threads&) = delete;
  Threads& operator=(const Threads&) = delete;

 private:
  int before_;
};

/// Name of a zoo entry, for INSTANTIATE_TEST_SUITE_P.
inline std::string entry_name(const ::testing::TestParamInfo<zoo::Entry>& info) {
  return info.param.name;
}

}  // namespace test
}  // namespace supple

/// Runs a TEST_P suite once for each zoo entry.
#define SUPPLE_OVER_THE_ZOO(suite)                                              \
  INSTANTIATE_TEST_SUITE_P(Zoo, suite, ::testing::ValuesIn(supple::zoo::all()), \
                           supple::test::entry_name)
