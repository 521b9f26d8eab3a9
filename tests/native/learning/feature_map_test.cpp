// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/feature_map.h"

#include <Eigen/LU>
#include <cmath>
#include <complex>
#include <utility>

#include "native/gradient_check.h"
#include "native/support.h"
#include "supple/learning/functional_map_loss.h"

namespace supple {
namespace {

struct Problem {
  RowMatrix<double> source = test::noise(6, 9, 1);
  RowMatrix<double> target = test::noise(5, 9, 2);
  RowMatrix<double> penalties = 0.7 * test::noise(6, 5, 3).cwiseAbs();
};

TEST(FeatureMap, SolvesTheNormalEquationsOfAllEntriesTogether) {
  const Problem p;
  Eigen::MatrixXd system = Eigen::MatrixXd::Zero(30, 30);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(30);
  for (Eigen::Index f = 0; f < 9; ++f) {
    for (Eigen::Index i = 0; i < 6; ++i) {
      Eigen::VectorXd equation = Eigen::VectorXd::Zero(30);  // one entry of C A_t - A_s
      equation.segment(5 * i, 5) = p.target.col(f);
      system += equation * equation.transpose();
      right += p.source(i, f) * equation;
    }
  }
  system.diagonal() += Eigen::Map<const Eigen::VectorXd>(p.penalties.data(), 30);
  const Eigen::VectorXd truth = system.fullPivLu().solve(right);
  const RowMatrix<double> map = feature_map(p.source, p.target, p.penalties);
  EXPECT_LT((Eigen::Map<const Eigen::VectorXd>(map.data(), 30) - truth).cwiseAbs().maxCoeff(),
            1e-10);
}

TEST(FeatureMap, FindsAnyMapThatFeaturesFollowAndADiagonalOneAtAnyWeight) {
  const RowMatrix<double> target = test::noise(5, 9, 2), truth = test::noise(6, 5, 4);
  EXPECT_LT((feature_map(truth * target, target, RowMatrix<double>::Zero(6, 5)) - truth)
                .cwiseAbs()
                .maxCoeff(),
            1e-10);
  const Eigen::VectorXd values = Eigen::VectorXd::LinSpaced(5, 0.0, 40.0);
  const Eigen::VectorXd signs = Eigen::VectorXd::LinSpaced(5, 0, 4).array().cos().sign();
  const RowMatrix<double> flipped = signs.asDiagonal() * target;
  for (const MapPenalty penalty : {MapPenalty::resolvent, MapPenalty::commutator}) {
    const RowMatrix<double> map = feature_map(
        flipped, target, map_penalties(values, values, {.penalty = penalty, .weight = 1e4}));
    EXPECT_LT((map - RowMatrix<double>(signs.asDiagonal())).cwiseAbs().maxCoeff(), 1e-9);
  }
}

TEST(FeatureMap, PenaltiesAreDifferencesOfResolventsOrEigenvalues) {
  const Eigen::VectorXd source = Eigen::Vector3d(0.0, 3.0, 11.0);
  const Eigen::VectorXd target = Eigen::Vector4d(0.0, 2.0, 8.0, 20.0);
  const RowMatrix<double> resolvent = map_penalties(source, target);
  const RowMatrix<double> commutator =
      map_penalties(source, target, {.penalty = MapPenalty::commutator, .weight = 7.0});
  const std::complex<double> i(0.0, 1.0);
  for (Eigen::Index s = 0; s < 3; ++s) {
    for (Eigen::Index t = 0; t < 4; ++t) {
      const std::complex<double> difference =
          1.0 / (std::sqrt(source[s] / 20.0) - i) - 1.0 / (std::sqrt(target[t] / 20.0) - i);
      EXPECT_NEAR(resolvent(s, t), 100.0 * std::norm(difference), 1e-12);
      EXPECT_NEAR(commutator(s, t), 7.0 * std::pow((source[s] - target[t]) / 20.0, 2), 1e-12);
    }
  }
  EXPECT_LT((map_penalties(5.0 * source, 5.0 * target) - resolvent).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_TRUE(map_penalties(Eigen::VectorXd::Zero(1), Eigen::VectorXd::Zero(1)).isZero());
}

TEST(FeatureMap, Gradient) {
  const test::Threads threads(1);  // far too small to share
  Problem p;
  const RowMatrix<double> direction = test::noise(6, 5, 5);
  const auto value = [&] {
    return feature_map(p.source, p.target, p.penalties).cwiseProduct(direction).sum();
  };
  const FeatureMapGradient gradient = feature_map_backward(
      p.source, p.target, p.penalties, feature_map(p.source, p.target, p.penalties), direction);
  EXPECT_TRUE(
      test::gradient_matches(value, test::values_of(p.source), test::values_of(gradient.source)));
  EXPECT_TRUE(
      test::gradient_matches(value, test::values_of(p.target), test::values_of(gradient.target)));
}

TEST(FeatureMap, RefusesWhatHasNoMeaning) {
  const Problem p;
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"6 x 8", "5 x 9"},
                               [&] { feature_map(p.source.leftCols(8), p.target, p.penalties); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"5 x 6"}, [&] {
    feature_map_backward(p.source, p.target, p.penalties, p.penalties.transpose(), p.penalties);
  }));
  RowMatrix<double> broken = p.source;
  broken(1, 2) = std::nan("");
  EXPECT_TRUE(test::fails_with(ErrorCode::not_finite, {"NaN"},
                               [&] { feature_map(broken, p.target, p.penalties); }));
  // Three features do not determine rows of five without a penalty.
  EXPECT_TRUE(test::fails_with(ErrorCode::not_positive_definite, {"3 features"}, [&] {
    feature_map(RowMatrix<double>::Ones(6, 3), RowMatrix<double>::Ones(5, 3),
                RowMatrix<double>::Zero(6, 5));
  }));
  const Eigen::VectorXd values = Eigen::Vector3d(0.0, 1.0, 2.0);
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"weight -1"},
                               [&] { map_penalties(values, values, {.weight = -1.0}); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"exponent 0"},
                               [&] { map_penalties(values, values, {.exponent = 0.0}); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::not_finite, {"negative"},
                               [&] { map_penalties(-values, values); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"'mask'"}, [&] { map_penalty("mask"); }));
  for (const MapPenalty penalty : {MapPenalty::resolvent, MapPenalty::commutator}) {
    EXPECT_EQ(map_penalty(to_string(penalty)), penalty);
  }
}

TEST(FunctionalMapLoss, Gradients) {
  RowMatrix<double> c = test::noise(6, 5, 1), other = test::noise(6, 5, 2);
  RowMatrix<double> back = test::noise(5, 6, 3);
  const RowMatrix<double> zero = RowMatrix<double>::Zero(6, 5);
  RowMatrix<double> grad = zero, grad_other = zero, grad_back = zero.transpose();
  const auto total = [&] {
    return 2.0 * orthogonality_loss(c) + 3.0 * coupling_loss(c, other) +
           5.0 * bijectivity_loss(c, back);
  };
  orthogonality_loss(c, 2.0, &grad);
  coupling_loss(c, other, 3.0, &grad, &grad_other);
  bijectivity_loss(c, back, 5.0, &grad, &grad_back);
  EXPECT_TRUE(
      test::gradient_matches(total, test::values_of(c), test::values_of(std::as_const(grad))));
  EXPECT_TRUE(test::gradient_matches(total, test::values_of(other),
                                     test::values_of(std::as_const(grad_other))));
  EXPECT_TRUE(test::gradient_matches(total, test::values_of(back),
                                     test::values_of(std::as_const(grad_back))));
}

TEST(FunctionalMapLoss, ByHand) {
  const RowMatrix<double> turn = test::rotation(1), twice = 2.0 * turn;
  EXPECT_LT(orthogonality_loss(turn), 1e-20);
  EXPECT_LT(bijectivity_loss(turn, turn.transpose()), 1e-20);
  EXPECT_NEAR(orthogonality_loss(twice), 3.0 * 9.0, 1e-12);            // 4 I - I
  EXPECT_NEAR(bijectivity_loss(twice, turn.transpose()), 3.0, 1e-12);  // 2 I - I
  EXPECT_NEAR(coupling_loss(twice, turn), 3.0, 1e-12);                 // |turn|^2
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"3 x 2", "3 x 3"},
                               [&] { coupling_loss(turn, turn.leftCols(2)); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"3 x 2", "3 x 3"},
                               [&] { bijectivity_loss(turn, turn.leftCols(2)); }));
}

}  // namespace
}  // namespace supple
