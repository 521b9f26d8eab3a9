// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/unsupervised_loss.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "native/gradient_check.h"
#include "native/support.h"
#include "supple/geometry/face_adjacency.h"
#include "supple/geometry/jacobians.h"

namespace supple {
namespace {

// --- Jacobians
// ------------------------------------------------------------------------------------

class FaceAdjacency : public ::testing::TestWithParam<zoo::Entry> {};

TEST_P(FaceAdjacency, IsTheMeanOfFacesWithACommonEdge) {
  const TriangleMesh mesh(GetParam().mesh.vertices, GetParam().mesh.faces);
  const Faces& faces = mesh.surface_faces();
  const RowMatrix<double> adjacency =
      RowMatrix<double>(face_adjacency(faces, CornerTable(faces, mesh.surface_vertices().rows())));
  ASSERT_EQ(adjacency.rows(), faces.rows());
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    EXPECT_NEAR(adjacency.row(f).sum(), 1.0, 1e-14);
    std::set<Eigen::Index> truth;
    for (Eigen::Index g = 0; g < faces.rows(); ++g) {
      int common = 0;
      for (int c = 0; c < 3; ++c) {
        common += (faces.row(g).array() == faces(f, c)).any() ? 1 : 0;
      }
      if (g != f && common >= 2) {
        truth.insert(g);
      }
    }
    std::set<Eigen::Index> found;
    for (Eigen::Index g = 0; g < faces.rows(); ++g) {
      if (adjacency(f, g) > 0.0 && (g != f || !truth.empty())) {
        found.insert(g);
      }
    }
    EXPECT_EQ(found, truth) << "face " << f;
  }
}
SUPPLE_OVER_THE_ZOO(FaceAdjacency);

class JacobianLoss : public ::testing::Test {
 protected:
  JacobianLoss()
      : mesh(zoo::perturbed_sphere(0, 3)),
        operators(TriangleMesh(mesh.vertices, mesh.faces)),
        adjacency(face_adjacency(operators.faces, operators.corners)) {}
  JacobianLossValues loss(const MatrixField& rough, const MatrixField& predicted) const {
    return jacobian_loss(operators, adjacency, {}, rough, predicted);
  }
  MatrixField everywhere(const Matrix3& matrix) const {
    MatrixField field(operators.faces.rows(), 9);
    for (Eigen::Index f = 0; f < field.rows(); ++f) {
      matrix_at(field, f) = matrix;
    }
    return field;
  }

  zoo::Mesh mesh;
  SurfaceOperators operators;
  SparseRowMatrix adjacency;
};

TEST_F(JacobianLoss, ByHand) {
  const MatrixField one = everywhere(Matrix3::Identity());
  // Twice a rotation where the rotation is right: |Q|^2 = 3, nothing rough, (8 - 1)^2.
  const JacobianLossValues twice =
      loss(everywhere(test::rotation(1)), everywhere(2.0 * test::rotation(1)));
  EXPECT_NEAR(twice.fit, 3.0, 1e-12);
  EXPECT_NEAR(twice.smoothness, 0.0, 1e-20);
  EXPECT_NEAR(twice.determinant, 49.0, 1e-10);
  EXPECT_NEAR(twice.total, 3.0 + 10.0 * 49.0, 1e-9);
  // One face sheared by |S|^2 = 4 at volume 1: it differs from its three neighbours by S, each of
  // them from its own by S / 3.
  MatrixField sheared = one;
  matrix_at(sheared, 5)(0, 1) += 2.0;
  double around = 0.0;
  for (SparseRowMatrix::InnerIterator it(adjacency, 5); it; ++it) {
    around += operators.face_areas[it.col()];
  }
  const JacobianLossValues one_face = loss(one, sheared);
  EXPECT_NEAR(one_face.fit, 4.0 * operators.face_areas[5], 1e-12);
  EXPECT_NEAR(one_face.smoothness, 4.0 * operators.face_areas[5] + 4.0 / 9.0 * around, 1e-12);
  EXPECT_NEAR(one_face.determinant, 0.0, 1e-20);
}

TEST_F(JacobianLoss, GradientOfEachTermAndOfAll) {
  MatrixField rough = everywhere(test::rotation(1)), predicted = everywhere(test::rotation(2));
  rough += 0.2 * MatrixField(test::noise(rough.rows(), 9, 3));
  predicted += 0.2 * MatrixField(test::noise(rough.rows(), 9, 4));
  for (const JacobianWeights weights : {JacobianWeights{1, 0, 0}, JacobianWeights{0, 1, 0},
                                        JacobianWeights{0, 0, 1}, JacobianWeights{}}) {
    JacobianLossGradient gradient;
    jacobian_loss(operators, adjacency, weights, rough, predicted, &gradient);
    const auto value = [&] {
      return jacobian_loss(operators, adjacency, weights, rough, predicted).total;
    };
    EXPECT_TRUE(test::gradient_matches(value, test::values_of(predicted),
                                       test::values_of(std::as_const(gradient.predicted)), 60));
    EXPECT_TRUE(test::gradient_matches(value, test::values_of(rough),
                                       test::values_of(std::as_const(gradient.rough)), 60));
  }
}

TEST_F(JacobianLoss, DoesNotSeeTurnsOfEitherSide) {
  const MatrixField rough(test::noise(operators.faces.rows(), 9, 3));
  const MatrixField predicted(test::noise(operators.faces.rows(), 9, 4));
  const auto turned = [&](MatrixField field) {
    for (Eigen::Index f = 0; f < field.rows(); ++f) {
      matrix_at(field, f) =
          Matrix3(test::rotation(1).transpose() * matrix_at(field, f) * test::rotation(2));
    }
    return field;
  };
  EXPECT_NEAR(loss(turned(rough), turned(predicted)).total, loss(rough, predicted).total, 1e-9);
}

TEST_F(JacobianLoss, RefusesOtherNumbersOfFacesAndNaN) {
  const MatrixField field = everywhere(Matrix3::Identity());
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"1 predicted", "20 faces"},
                               [&] { loss(field, field.topRows(1)); }));
  MatrixField broken = field;
  broken(3, 4) = std::nan("");
  EXPECT_TRUE(test::fails_with(ErrorCode::not_finite, {"predicted"}, [&] { loss(field, broken); }));
}

// --- pairs
// ----------------------------------------------------------------------------------------

struct Surface {
  Surface(const zoo::Mesh& mesh, int count)
      : operators(TriangleMesh(mesh.vertices, mesh.faces)),
        basis(eigenbasis(operators.laplacian, operators.mass, {.count = count})),
        match(operators, basis, count) {}

  SurfaceOperators operators;
  Eigenbasis basis;
  MatchSurface match;
};

// The mesh with its vertices in the opposite order.
zoo::Mesh reversed(const zoo::Mesh& mesh) {
  const int last = static_cast<int>(mesh.vertices.rows()) - 1;
  return {mesh.vertices.colwise().reverse(), Faces(last - mesh.faces.array())};
}

class UnsupervisedLoss : public ::testing::Test {
 protected:
  UnsupervisedLoss()
      : first(zoo::perturbed_sphere(0, 3), 7),
        second(
            {test::bent(zoo::perturbed_sphere(1, 4).vertices), zoo::perturbed_sphere(1, 4).faces},
            6),
        pair{&first.match, &second.match},
        features{test::noise(12, 8, 1), test::noise(42, 8, 2)} {
    for (size_t d = 0; d < 2; ++d) {
      predicted[d] = MatrixField(test::noise(pair[d]->operators->faces.rows(), 9, 5 + d));
    }
    options.temperature = 0.3;
    options.map.weight = 0.1;
    options.bijectivity = 0.5;
  }
  double total() const {
    return unsupervised_loss(pair, match(pair, features, options), predicted, options).total;
  }

  // Of the match, each weighed by noise.
  void check_every_output() {
    const Match forward = match(pair, features, options);
    Match direction;
    for (size_t d = 0; d < 2; ++d) {
      const auto like = [&](const auto& matrix, uint64_t seed) {
        return test::noise(matrix.rows(), matrix.cols(), seed);
      };
      direction[d] = {like(forward[d].map, 1), like(forward[d].soft_map, 2),
                      Points(like(forward[d].pulled, 3)), Points(like(forward[d].coarse, 4))};
    }
    const auto value = [&] {
      const Match now = match(pair, features, options);
      double sum = 0.0;
      for (size_t d = 0; d < 2; ++d) {
        sum += now[d].map.cwiseProduct(direction[d].map).sum() +
               now[d].soft_map.cwiseProduct(direction[d].soft_map).sum() +
               now[d].pulled.cwiseProduct(direction[d].pulled).sum() +
               now[d].coarse.cwiseProduct(direction[d].coarse).sum();
      }
      return sum;
    };
    const FeaturePair<double> gradient =
        match_backward(pair, features, forward, direction, options);
    for (size_t d = 0; d < 2; ++d) {
      EXPECT_TRUE(test::gradient_matches(value, test::values_of(features[d]),
                                         test::values_of(gradient[d]), 60));
    }
  }

  test::Threads threads{1};  // far too small to share
  Surface first, second;
  SurfacePair pair;
  FeaturePair<double> features;
  std::array<MatrixField, 2> predicted;
  UnsupervisedOptions options;
};

TEST_F(UnsupervisedLoss, Gradient) {
  const Match forward = match(pair, features, options);
  UnsupervisedLossGradient gradient;
  unsupervised_loss(pair, forward, predicted, options, &gradient);
  const FeaturePair<double> of_features =
      match_backward(pair, features, forward, gradient.match, options);
  for (size_t d = 0; d < 2; ++d) {
    EXPECT_TRUE(test::gradient_matches([&] { return total(); }, test::values_of(predicted[d]),
                                       test::values_of(std::as_const(gradient.predicted[d])), 40));
    EXPECT_TRUE(test::gradient_matches([&] { return total(); }, test::values_of(features[d]),
                                       test::values_of(of_features[d]), 60));
  }
}

TEST_F(UnsupervisedLoss, GradientOfEveryOutputOfTheMatch) {
  check_every_output();
  options.smooth_features = true;
  check_every_output();
}

TEST_F(UnsupervisedLoss, EmptyGradientsAreZero) {
  const Match forward = match(pair, features, options);
  for (const RowMatrix<double>& grad : match_backward(pair, features, forward, {}, options)) {
    EXPECT_TRUE(grad.isZero());
  }
}

// Soft maps of float features; at this temperature their weights are good to about 1e-6.
TEST_F(UnsupervisedLoss, SinglePrecisionFeaturesGiveTheSame) {
  const FeaturePair<float> single = {features[0].cast<float>(), features[1].cast<float>()};
  features = {single[0].cast<double>(), single[1].cast<double>()};
  const Match forward = match(pair, features, options), rough = match(pair, single, options);
  for (size_t d = 0; d < 2; ++d) {
    EXPECT_EQ(rough[d].map, forward[d].map);
    EXPECT_LT((rough[d].soft_map - forward[d].soft_map).norm(), 1e-5 * forward[d].soft_map.norm());
    EXPECT_LT(test::farthest(rough[d].pulled, forward[d].pulled), 1e-5);
    EXPECT_LT(test::farthest(rough[d].coarse, forward[d].coarse), 1e-5);
  }
  UnsupervisedLossGradient gradient;
  unsupervised_loss(pair, forward, predicted, options, &gradient);
  const FeaturePair<double> truth =
      match_backward(pair, features, forward, gradient.match, options);
  const FeaturePair<float> actual = match_backward(pair, single, rough, gradient.match, options);
  for (size_t d = 0; d < 2; ++d) {
    EXPECT_LT((actual[d].cast<double>() - truth[d]).norm(), 1e-5 * truth[d].norm());
  }
}

TEST_F(UnsupervisedLoss, TermsAreWeightedAndSwitchedOff) {
  const Match forward = match(pair, features, options);
  const UnsupervisedLossValues v =
      unsupervised_loss(pair, forward, predicted, UnsupervisedOptions{});
  EXPECT_NEAR(v.total,
              v.orthogonality + v.coupling + v.fit + 20.0 * v.smoothness + 10.0 * v.determinant,
              1e-9 * v.total);
  const UnsupervisedLossValues maps = unsupervised_loss(pair, forward, {}, options);
  EXPECT_EQ(maps.fit + maps.smoothness + maps.determinant, 0.0);
  EXPECT_NEAR(maps.total, v.orthogonality + v.coupling + 0.5 * v.bijectivity, 1e-9 * v.total);
}

TEST_F(UnsupervisedLoss, DoesNotSeeTheSignsOfEigenfunctions) {
  const double before = total();
  const RowMatrix<double> grad_before = match_backward(
      pair, features, match(pair, features, options),
      [&] {
        UnsupervisedLossGradient gradient;
        unsupervised_loss(pair, match(pair, features, options), predicted, options, &gradient);
        return gradient.match;
      }(),
      options)[0];
  Eigenbasis flipped = first.basis;
  for (Eigen::Index i = 0; i < flipped.size(); i += 2) {
    flipped.functions.col(i) *= -1.0;
  }
  const MatchSurface other(first.operators, flipped, 7);
  pair[0] = &other;
  EXPECT_NEAR(total(), before, 1e-9 * before);
  const Match forward = match(pair, features, options);
  UnsupervisedLossGradient gradient;
  unsupervised_loss(pair, forward, predicted, options, &gradient);
  const RowMatrix<double> grad =
      match_backward(pair, features, forward, gradient.match, options)[0];
  EXPECT_LT((grad - grad_before).cwiseAbs().maxCoeff(), 1e-7 * grad.cwiseAbs().maxCoeff());
}

TEST_F(UnsupervisedLoss, DoesNotSeeTheOrderOfVertices) {
  const double before = total();
  const Surface other(reversed(zoo::perturbed_sphere(0, 3)), 7);
  pair[0] = &other.match;
  features[0] = RowMatrix<double>(features[0].colwise().reverse());
  EXPECT_NEAR(total(), before, 1e-7 * before);
}

TEST_F(UnsupervisedLoss, SameThreadsSameBytes) {
  const test::Threads two(2);
  const auto run = [&] {
    const Match forward = match(pair, features, options);
    UnsupervisedLossGradient gradient;
    unsupervised_loss(pair, forward, predicted, options, &gradient);
    return match_backward(pair, features, forward, gradient.match, options);
  };
  const FeaturePair<double> a = run(), b = run();
  EXPECT_EQ(a[0], b[0]);
  EXPECT_EQ(a[1], b[1]);
}

TEST_F(UnsupervisedLoss, RefusesWhatDoesNotFit) {
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"8 functions", "7"},
                               [&] { MatchSurface(first.operators, first.basis, 8); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"42", "12"},
                               [&] { MatchSurface(first.operators, second.basis, 5); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"Surface 1", "41 x 8", "42 x 8"}, [&] {
    match<double>(pair, {features[0], features[1].topRows(41)}, options);
  }));
  Match forward = match(pair, features, options);
  forward[1].pulled = Points::Zero(3, 3);
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"Direction 1", "pulled"},
                               [&] { unsupervised_loss(pair, forward, predicted, options); }));
  // Without what `match` kept for the way back.
  Match stripped = match(pair, features, options);
  Match gradient;
  gradient[1].pulled = stripped[1].pulled;
  stripped[1].carried.resize(0, 0);
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"pulled back", "surface 1"}, [&] {
    match_backward(pair, features, stripped, gradient, options);
  }));
  Progress cancelled;
  cancelled.cancel();
  EXPECT_TRUE(test::fails_with(ErrorCode::cancelled, {},
                               [&] { match(pair, features, options, ProgressRange(&cancelled)); }));
}

TEST(UnsupervisedLossAtTheTruth, AllTermsVanishForTheSameShapeInAnotherOrder) {
  const zoo::Mesh mesh = zoo::perturbed_sphere(1, 3);
  const Surface first(mesh, 12), second(reversed(mesh), 12);
  const SurfacePair pair = {&first.match, &second.match};
  const RowMatrix<double> features = test::noise(42, 30, 1);
  UnsupervisedOptions options;
  options.temperature = 1e-3;  // as good as a permutation
  options.bijectivity = 1.0;
  const FeaturePair<double> both = {features, features.colwise().reverse()};
  const Match forward = match(pair, both, options);
  // The functional map of the permutation: the same functions, up to their signs.
  for (size_t d = 0; d < 2; ++d) {
    const RowMatrix<double> truth =
        pair[d]->weighted.transpose() * pair[1 - d]->functions.colwise().reverse();
    EXPECT_LT((truth.cwiseAbs() - RowMatrix<double>::Identity(12, 12)).cwiseAbs().maxCoeff(), 1e-6);
    EXPECT_LT((forward[d].map - truth).cwiseAbs().maxCoeff(), 1e-6);
    EXPECT_LT((forward[d].soft_map - truth).cwiseAbs().maxCoeff(), 1e-6);
    EXPECT_LT(test::farthest(forward[d].pulled, pair[d]->operators->vertices), 1e-6);
    EXPECT_LT(
        test::farthest(forward[d].coarse, pair[d]->functions * (pair[d]->weighted.transpose() *
                                                                pair[d]->operators->vertices)),
        1e-6);
  }
  std::array<MatrixField, 2> predicted;
  for (size_t d = 0; d < 2; ++d) {
    predicted[d] = pair[d]->operators->jacobians_of(pair[d]->operators->vertices);
  }
  UnsupervisedLossGradient gradient;
  const UnsupervisedLossValues loss =
      unsupervised_loss(pair, forward, predicted, options, &gradient);
  EXPECT_LT(loss.orthogonality, 1e-10);
  EXPECT_LT(loss.coupling, 1e-10);
  EXPECT_LT(loss.bijectivity, 1e-10);
  EXPECT_LT(loss.total, 1e-9);
  // And a wrong map costs.
  EXPECT_GT(unsupervised_loss(pair, match<double>(pair, {features, features}, options), predicted,
                              options)
                .total,
            1.0);
}

}  // namespace
}  // namespace supple
