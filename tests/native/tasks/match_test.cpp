// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/tasks/match.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "native/learning/joint_surfaces.h"

namespace supple {
namespace {

using Prepared = std::shared_ptr<const PreparedMesh>;

// A body without symmetry, and the order that a copy's vertices were put in.
class Matching : public ::testing::Test {
 protected:
  Matching() : mesh(zoo::perturbed_sphere(3, 5)) {
    for (Eigen::Index i = 0; i < mesh.vertices.rows(); ++i) {
      auto v = mesh.vertices.row(i);
      const double head = std::exp(-6.0 * (v - Eigen::RowVector3d(1, 0, 0)).squaredNorm());
      const double arm = std::exp(-8.0 * (v - Eigen::RowVector3d(0, 0.8, 0.6)).squaredNorm());
      v *= 1.0 + 0.9 * head + 0.5 * arm;
      v[2] *= 0.7;
    }
    order = Eigen::VectorXi::LinSpaced(mesh.vertices.rows(), 0,
                                       static_cast<int>(mesh.vertices.rows()) - 1);
    std::shuffle(order.begin(), order.end(), std::mt19937(3));
    copy.vertices.resize(mesh.vertices.rows(), 3);
    for (Eigen::Index i = 0; i < order.size(); ++i) {
      copy.vertices.row(order[i]) = 2.0 * mesh.vertices.row(i) * test::rotation(2);
    }
    copy.faces = mesh.faces.unaryExpr([&](int v) { return order[v]; });
    options.training.epochs = 2;
    options.functions = 20;
    options.refine.counts = {30, 40};
    options.automatic = false;
  }
  static Prepared prepared(const zoo::Mesh& mesh) {
    return std::make_shared<const PreparedMesh>(
        mesh.vertices, mesh.faces, PrepareOptions{.eigenfunctions = 48, .samples = 200});
  }
  // Mean distance to the true image, in roots of the area of the copy.
  double error(const Eigen::VectorXi& map) const {
    const Points images = copy.vertices(map, Eigen::all), truth = copy.vertices(order, Eigen::all);
    return (images - truth).rowwise().norm().mean() /
           TriangleMesh(copy.vertices, copy.faces).scale();
  }
  MatchNetworks networks() const { return test::small_networks<float>(4); }

  zoo::Mesh mesh, copy;
  Eigen::VectorXi order;  // vertex of the copy for each of the mesh
  MatchOptions options;
};

TEST_F(Matching, FindsACopySlow) {
  options.automatic = true;
  const Prepared a = prepared(mesh), b = prepared(copy);
  Matcher matcher(a, b, networks(), options);
  int epochs = 0;
  const MatchResult result = matcher.run({}, [&](const JointEpoch& epoch) {
    EXPECT_EQ(epoch.epoch, epochs++);
    EXPECT_EQ(epoch.pairs, 2);
  });
  EXPECT_EQ(epochs, 2);
  EXPECT_EQ(matcher.history().size(), 2u);
  EXPECT_LT(error(result.refined.point_map), 0.01);
  // What was returned bears refining best.
  const Refiner refiner(a, b, nullptr, options.refine);
  EXPECT_GE(result.refined.confidence.mean() + 0.05,
            refiner.refine(automatic_map(*a, *b).point_map).confidence.mean());
  EXPECT_GE(result.refined.confidence.mean() + 0.05,
            refiner.refine(matcher.features_map().point_map).confidence.mean());
}

// A ball with four bumps at places of its own.
zoo::Mesh bumpy(int seed) {
  zoo::Mesh mesh = zoo::perturbed_sphere(3, seed);
  const Points bumps = test::noise(4, 3, static_cast<uint64_t>(seed) * 7 + 1);
  for (Eigen::Index i = 0; i < mesh.vertices.rows(); ++i) {
    auto v = mesh.vertices.row(i);
    double factor = 1.0;
    for (int b = 0; b < 4; ++b) {
      factor += (0.4 + 0.3 * b) * std::exp(-8.0 * (v - bumps.row(b).normalized()).squaredNorm());
    }
    v *= factor;
    v[2] *= 0.7;
  }
  return mesh;
}

TEST_F(Matching, AMapFromTheOtherSideIsTakenWhereItBearsRefiningBetterSlow) {
  const Prepared a = prepared(bumpy(5)), b = prepared(bumpy(48));
  const double there = automatic_map(*a, *b).score.value();
  ASSERT_GT(automatic_map(*b, *a).score.value(), there + 0.05);
  options.automatic = true;
  options.training.epochs = 0;
  const MatchResult result = Matcher(a, b, networks(), options).run();
  EXPECT_TRUE(result.automatic);
  EXPECT_GT(result.initial.score.value(), there);
}

TEST_F(Matching, SymmetricShapesSaySoFromWhicheverSideTheMapCame) {
  const Prepared a = prepared(zoo::torus(40, 20)), b = prepared(zoo::torus(36, 20));
  options.automatic = true;
  options.training.epochs = 0;
  for (const auto& [source, target] : {std::pair(a, b), std::pair(b, a)}) {
    const MatchResult result = Matcher(source, target, networks(), options).run();
    ASSERT_TRUE(result.automatic);
    EXPECT_TRUE(std::any_of(result.initial.notes.begin(), result.initial.notes.end(),
                            [](const Note& note) { return note.code == "uncertain"; }));
  }
}

TEST_F(Matching, GoesOnAfterACancelledRunAndRepeatsItself) {
  const Prepared a = prepared(mesh), b = prepared(copy);
  Matcher stopped(a, b, networks(), options);
  Progress progress;
  EXPECT_TRUE(test::fails_with(ErrorCode::cancelled, {}, [&] {
    stopped.run(ProgressRange(&progress), [&](const JointEpoch&) { progress.cancel(); });
  }));
  EXPECT_EQ(stopped.history().size(), 1u);
  Matcher whole(a, b, networks(), options);
  const MatchResult result = stopped.run();
  EXPECT_FALSE(result.automatic);
  EXPECT_EQ(result.refined.point_map, whole.run().refined.point_map);
  EXPECT_EQ(stopped.networks().features.parameters.tensors(),
            whole.networks().features.parameters.tensors());
}

TEST_F(Matching, AMapThatBearsRefiningBetterGuidesTheAdaptationSlow) {
  options.automatic = true;
  options.training.epochs = 30;
  options.training.feature_learning_rate = {1e-2, 1e-2};
  Matcher matcher(prepared(mesh), prepared(copy), networks(), options);
  matcher.adapt();
  EXPECT_EQ(matcher.history()[0].guide_share, 1.0);
  EXPECT_GT(matcher.history()[19].guide_share, 0.0);
  EXPECT_EQ(matcher.history()[20].guide_share, 0.0);
  EXPECT_LT(matcher.history()[19].loss.guide, matcher.history()[0].loss.guide);
  options.automatic = false;
  options.training.epochs = 1;
  Matcher alone(prepared(mesh), prepared(copy), networks(), options);
  alone.adapt();
  EXPECT_EQ(alone.history()[0].guide_share, 0.0);
}

TEST_F(Matching, WithoutAGuideStepsAreShorter) {
  const Prepared a = prepared(mesh), b = prepared(copy);
  options.training.epochs = 1;
  const auto moved = [&](double rate) {
    options.unguided_rate = rate;
    Matcher matcher(a, b, networks(), options);
    matcher.adapt();
    const auto now = matcher.networks().features.parameters.tensors();
    double sum = 0.0;
    for (const auto& [name, before] : networks().features.parameters.tensors()) {
      sum += (now.at(name) - before).cast<double>().squaredNorm();
    }
    return std::sqrt(sum);
  };
  // Adam's steps are about as long as the learning rate.
  EXPECT_NEAR(moved(0.2) / moved(1.0), 0.2, 0.05);
}

TEST_F(Matching, LargeMeshesAreMatchedBySamplesWithoutAdaptation) {
  options.training.epochs = 0;
  const Prepared a = prepared(mesh), b = prepared(copy);
  const Eigen::VectorXi whole = Matcher(a, b, networks(), options).features_map().point_map;
  options.training.epochs = 2;
  options.most_pairs = 1000.0;
  Matcher large(a, b, networks(), options);
  ASSERT_EQ(large.notes().size(), 1u);
  EXPECT_EQ(large.notes()[0].code, "not_adapted");
  EXPECT_EQ(large.notes()[0].count, 642);
  large.adapt();
  EXPECT_TRUE(large.history().empty());
  // There are fewer vertices than samples, so all of them are compared.
  const Eigen::VectorXi sampled = large.features_map().point_map;
  EXPECT_GT(static_cast<double>((sampled.array() == whole.array()).count()), 0.99 * 642);
}

TEST_F(Matching, GuidesLeadThereAndBackSlow) {
  const Prepared a = prepared(mesh), b = prepared(copy);
  const GuideMaps guides = guide_maps(*a, *b, 20);
  EXPECT_LT(guides.round_trip, 0.05);
  EXPECT_LT(error(guides.point_maps[0]), 0.1);
  const auto surface = joint_surface(*a, networks(), 20);
  EXPECT_EQ(guides.maps[0].rows(), surface->match.values.size());
  // Back after there is nearly nothing, as for every map of equal areas.
  const RowMatrix<double> product = guides.maps[0] * guides.maps[1];
  EXPECT_LT((product - RowMatrix<double>::Identity(product.rows(), product.cols())).norm(), 1.0);
}

TEST_F(Matching, RefusesWhatItCannotDo) {
  const Prepared a = prepared(mesh);
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"target", "missing"},
                               [&] { Matcher(a, nullptr, networks(), options); }));
  options.training.epochs = -1;
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"0 epochs"},
                               [&] { Matcher(a, a, networks(), options); }));
  options.training.epochs = 1;
  options.unguided_rate = 0.0;
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"learning rate"},
                               [&] { Matcher(a, a, networks(), options); }));
}

}  // namespace
}  // namespace supple
