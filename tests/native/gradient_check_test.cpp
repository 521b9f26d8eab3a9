// SPDX-License-Identifier: GPL-3.0-or-later
// The gradient checker passes right derivatives and catches wrong ones.
#include "native/gradient_check.h"

#include "native/support.h"

namespace supple::test {
namespace {

class GradientChecker : public ::testing::Test {
 protected:
  // sum of exp(x0) sin(x1) + x2^3 / 3 ..., with all sizes of derivatives.
  double value() const {
    return std::exp(x[0]) * std::sin(x[1]) + x[2] * x[2] * x[2] / 3.0 + 100.0 * x[3];
  }
  Eigen::VectorXd gradient() const {
    return (Eigen::VectorXd(4) << std::exp(x[0]) * std::sin(x[1]), std::exp(x[0]) * std::cos(x[1]),
            x[2] * x[2], 100.0)
        .finished();
  }
  ::testing::AssertionResult check(const Eigen::VectorXd& analytic) {
    return gradient_matches([this] { return value(); }, values_of(x), values_of(analytic));
  }

  Eigen::VectorXd x = (Eigen::VectorXd(4) << 0.3, 0.9, -1.4, 2.0).finished();
};

TEST_F(GradientChecker, PassesTheRightOne) { EXPECT_TRUE(check(gradient())); }

TEST_F(GradientChecker, LeavesTheVariablesAsTheyWere) {
  const Eigen::VectorXd before = x;
  check(gradient());
  EXPECT_EQ(x, before);
}

TEST_F(GradientChecker, CatchesOneWrongEntry) {
  for (int i = 0; i < 4; ++i) {
    Eigen::VectorXd wrong = gradient();
    wrong[i] *= 1.0 + 1e-4;
    EXPECT_FALSE(check(wrong)) << "entry " << i;
  }
}

TEST_F(GradientChecker, CatchesAWrongSign) { EXPECT_FALSE(check(-gradient())); }

TEST_F(GradientChecker, CatchesAMissingTerm) {
  Eigen::VectorXd wrong = gradient();
  wrong[2] = 0.0;
  EXPECT_FALSE(check(wrong));
}

TEST_F(GradientChecker, CatchesAFactorOfTwo) { EXPECT_FALSE(check(2.0 * gradient())); }

TEST_F(GradientChecker, CatchesNaN) {
  Eigen::VectorXd wrong = gradient();
  wrong[1] = std::nan("");
  EXPECT_FALSE(check(wrong));
}

TEST_F(GradientChecker, CatchesAnotherNumberOfDerivatives) {
  EXPECT_FALSE(check(gradient().head(3)));
}

}  // namespace
}  // namespace supple::test
