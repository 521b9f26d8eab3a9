// SPDX-License-Identifier: GPL-3.0-or-later
#include "native/support.h"

#include <Eigen/Geometry>
#include <cmath>
#include <random>

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

}  // namespace supple::test
