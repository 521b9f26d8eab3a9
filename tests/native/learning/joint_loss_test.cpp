// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/joint_loss.h"

#include "native/gradient_check.h"
#include "native/learning/joint_surfaces.h"
#include "native/support.h"

namespace supple {
namespace {

class JointLoss : public ::testing::Test {
 protected:
  JointLoss() {
    options.temperature = 0.2;
    options.bijectivity = 0.5;
    for (size_t d = 0; d < 2; ++d) {
      const Eigen::Index rows = pair[d]->match.values.size();
      const Eigen::Index cols = pair[1 - d]->match.values.size();
      guide.maps[d] = test::noise(rows, cols, 40 + d);
    }
    guide.weight = 0.7;
  }
  double total() const {
    const JointLossValues loss = joint_loss(networks, pair, options, guide);
    return loss.total() + guide.weight * loss.guide;
  }

  test::PreparedSurface<double> first{test::body(3)}, second{test::body(4, 1.5)};
  JointPair<double> pair = {&first.surface, &second.surface};
  JointNetworks<double> networks = test::small_networks<double>(2);
  UnsupervisedOptions options;
  Guide guide;
};

TEST_F(JointLoss, FeatureGradientsMatchFiniteDifferences) {
  JointGradient<double> gradient;
  joint_loss(networks, pair, options, guide, &gradient);
  const auto tensors = networks.features.parameters.named();
  const auto slopes = gradient.features.named();
  for (size_t t = 0; t < tensors.size(); ++t) {
    // Differences of 1e-3 are too long for times of 0.02; `diffusion_net_backward` is checked
    // alone.
    if (tensors[t].name.ends_with("times")) {
      continue;
    }
    EXPECT_TRUE(test::gradient_matches([&] { return total(); }, test::values_of(*tensors[t].values),
                                       test::values_of(*slopes[t].values), 4, 1e-4))
        << tensors[t].name;
  }
}

TEST_F(JointLoss, JacobianGradientsMatchFiniteDifferences) {
  JointGradient<double> gradient;
  joint_loss(networks, pair, options, guide, &gradient);
  auto& parameters = networks.jacobians->parameters();
  for (size_t l = 0; l < parameters.weights.size(); ++l) {
    EXPECT_TRUE(test::gradient_matches([&] { return total(); },
                                       test::values_of(parameters.weights[l]),
                                       test::values_of(gradient.jacobians.weights[l]), 6))
        << "layer " << l;
    EXPECT_TRUE(test::gradient_matches([&] { return total(); },
                                       test::values_of(parameters.biases[l]),
                                       test::values_of(gradient.jacobians.biases[l]), 4))
        << "layer " << l;
  }
}

// The deformation's part of the loss reaches the features only through its two inputs.
TEST_F(JointLoss, TheDeformationTeachesTheFeatures) {
  JointGradient<double> with, without;
  joint_loss(networks, pair, options, {}, &with);
  options.jacobians = {0.0, 0.0, 0.0};
  joint_loss(networks, pair, options, {}, &without);
  EXPECT_GT((with.features.last.weight - without.features.last.weight).norm(),
            1e-3 * without.features.last.weight.norm());
  EXPECT_TRUE(without.jacobians.weights.front().isZero());
}

TEST_F(JointLoss, GuideDrawsSoftMapsToItself) {
  const JointLossValues loss = joint_loss(networks, pair, options, guide);
  std::array<RowMatrix<double>, 2> features;
  for (size_t d = 0; d < 2; ++d) {
    features[d] = networks.features.features(pair[d]->features);
  }
  const Match found = match<double>({&pair[0]->match, &pair[1]->match}, features, options);
  double truth = 0.0;
  for (size_t d = 0; d < 2; ++d) {
    truth += (guide.maps[d] - found[d].soft_map).squaredNorm();
  }
  EXPECT_NEAR(loss.guide, truth, 1e-10 * truth);
  EXPECT_EQ(joint_loss(networks, pair, options, {}).guide, 0.0);
}

TEST_F(JointLoss, DoesNotSeeWhereOrHowLargeASurfaceIs) {
  guide = {};
  const double before = total();
  zoo::Mesh mesh = test::body(3);
  mesh.vertices = (2.5 * mesh.vertices * test::rotation(4)).eval();
  const test::PreparedSurface<double> turned(mesh);
  pair[0] = &turned.surface;
  EXPECT_NEAR(total(), before, 1e-6 * before);
}

TEST_F(JointLoss, DoesNotSeeTheOrderOfVertices) {
  guide = {};
  const double before = total();
  zoo::Mesh mesh = test::body(3);
  const Points vertices = mesh.vertices.colwise().reverse();
  mesh.faces = (static_cast<int>(vertices.rows()) - 1 - mesh.faces.array()).matrix().eval();
  mesh.vertices = vertices;
  const test::PreparedSurface<double> other(mesh);
  pair[0] = &other.surface;
  EXPECT_NEAR(total(), before, 1e-6 * before);
}

TEST_F(JointLoss, RefusesASurfaceWithoutTheNetwork) {
  const JointSurface<double> bare(first.operators, first.basis, test::small_features(), 9, nullptr);
  pair[0] = &bare;
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"without the local Jacobian network"},
                               [&] { total(); }));
  options.jacobians = {0.0, 0.0, 0.0};
  EXPECT_GT(total(), 0.0);
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"0 functions", "at least 1"}, [&] {
    JointSurface<double>(first.operators, first.basis, test::small_features(), 0, nullptr);
  }));
}

}  // namespace
}  // namespace supple
