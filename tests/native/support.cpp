// SPDX-License-Identifier: GPL-3.0-or-later
#include "native/support.h"

#include <omp.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstdlib>
#include <random>

#include "supple/core/simd.h"

namespace supple::test {

RowMatrix<double> noise(Eigen::Index rows, Eigen::Index cols, uint64_t seed) {
  std::mt19937_64 generator(seed);
  RowMatrix<double> result(rows, cols);
  for (Eigen::Index i = 0; i < result.size(); ++i) {
    result.data()[i] = static_cast<double>(generator() >> 11) * 0x1.0p-52 - 1.0;
  }
  return result;
}

Matrix3 rotation(uint64_t which) {
  const RowMatrix<double> axis = noise(1, 3, 1000 + which);
  const double angle = 0.7 + 0.61 * static_cast<double>(which % 4);
  return Eigen::AngleAxisd(angle, Eigen::Vector3d(axis.row(0).transpose()).normalized())
      .toRotationMatrix();
}

Points bent(const Points& points) {
  const Eigen::RowVector3d low = points.colwise().minCoeff(), high = points.colwise().maxCoeff();
  const double size = (high - low).norm();
  Points result(points.rows(), 3);
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    const Eigen::RowVector3d p = (points.row(i) - low) / size;
    const double turn = 1.1 * p[2] + 0.4 * p[0];
    result.row(i) << p[0] * std::cos(turn) - p[1] * std::sin(turn) + 0.2 * p[2] * p[2],
        p[0] * std::sin(turn) + p[1] * std::cos(turn) - 0.3 * p[0] * p[1],
        1.2 * p[2] + 0.25 * std::sin(2.0 * p[0] + p[1]);
  }
  return (result * size).rowwise() + low;
}

double diagonal(const Points& points) {
  return (points.colwise().maxCoeff() - points.colwise().minCoeff()).norm();
}

double farthest(const Points& a, const Points& b) { return (a - b).rowwise().norm().maxCoeff(); }

::testing::AssertionResult fails_with(ErrorCode code, std::initializer_list<const char*> parts,
                                      const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    const std::string message = error.what();
    if (error.code() != code) {
      return ::testing::AssertionFailure() << "expected " << to_string(code) << ", got "
                                           << to_string(error.code()) << ": " << message;
    }
    for (const char* part : parts) {
      if (message.find(part) == std::string::npos) {
        return ::testing::AssertionFailure() << "no '" << part << "' in: " << message;
      }
    }
    return ::testing::AssertionSuccess();
  } catch (const std::exception& error) {
    return ::testing::AssertionFailure() << "not a supple::Error: " << error.what();
  }
  return ::testing::AssertionFailure() << "expected " << to_string(code) << ", nothing was thrown";
}

void at_every_simd_level(const std::function<void()>& check) {
  const char* const before = std::getenv("SUPPLE_SIMD");
  const std::string kept = before == nullptr ? "" : before;
  // A new process, not only a fork: the level is read once, and OpenMP's threads do not survive
  // one.
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  for (const SimdLevel level : {SimdLevel::plain, SimdLevel::avx2, SimdLevel::avx512}) {
    setenv("SUPPLE_SIMD", to_string(level), 1);
    EXPECT_EXIT(
        {
          if (simd_level() == level) {
            check();
          } else {
            EXPECT_LT(simd_level(), level);
          }
          std::exit(::testing::Test::HasFailure() ? 1 : 0);
        },
        ::testing::ExitedWithCode(0), "")
        << to_string(level);
  }
  if (before == nullptr) {
    unsetenv("SUPPLE_SIMD");
  } else {
    setenv("SUPPLE_SIMD", kept.c_str(), 1);
  }
}

Threads::Threads(int count) : before_(omp_get_max_threads()) { omp_set_num_threads(count); }
Threads::~Threads() { omp_set_num_threads(before_); }

}  // namespace supple::test
