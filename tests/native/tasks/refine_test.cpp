// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/tasks/refine.h"

#include <numeric>
#include <random>

#include "native/learning/networks.h"
#include "supple/spectral/functional_map.h"

namespace supple {
namespace {

using Prepared = std::shared_ptr<const PreparedMesh>;
using Net = std::shared_ptr<const LocalJacobianNetwork<float>>;

const RefineOptions kRounds{.counts = {40, 60}};

Prepared prepared(const Points& vertices, const Faces& faces) {
  return std::make_shared<const PreparedMesh>(vertices, faces,
                                              PrepareOptions{.eigenfunctions = 64, .samples = 200});
}
Prepared prepared(const zoo::Mesh& mesh) { return prepared(mesh.vertices, mesh.faces); }

Eigen::VectorXi identity(Eigen::Index n) {
  return Eigen::VectorXi::LinSpaced(n, 0, static_cast<int>(n) - 1);
}

// Every third vertex maps to one up to two edges from where it should.
Eigen::VectorXi noisy_identity(const zoo::Mesh& mesh, unsigned seed) {
  const Eigen::Index n = mesh.vertices.rows();
  std::vector<std::vector<int>> near(static_cast<size_t>(n));
  for (Eigen::Index f = 0; f < mesh.faces.rows(); ++f) {
    for (int c = 0; c < 3; ++c) {
      near[static_cast<size_t>(mesh.faces(f, c))].push_back(mesh.faces(f, (c + 1) % 3));
    }
  }
  std::mt19937 random(seed);
  Eigen::VectorXi map = identity(n);
  for (Eigen::Index i = 0; i < n; i += 3) {
    for (int step = 0; step < 2; ++step) {
      const std::vector<int>& options = near[static_cast<size_t>(map[i])];
      map[i] = options[random() % options.size()];
    }
  }
  return map;
}

// RMS distance between two maps' images.
double apart(const Points& target, const Eigen::VectorXi& a, const Eigen::VectorXi& b) {
  return std::sqrt((target(a, Eigen::all) - target(b, Eigen::all)).squaredNorm() /
                   static_cast<double>(a.size()));
}

double share_equal(const Eigen::VectorXi& a, const Eigen::VectorXi& b) {
  return (a.array() == b.array()).cast<double>().mean();
}

Net awake(double size = 0.05) {
  const test::RestMesh<float> rest(zoo::perturbed_sphere(2, 3), 64, 0);
  const Points target = test::bent(rest.operators.vertices);
  return std::make_shared<const LocalJacobianNetwork<float>>(test::awake_network<float>(
      {.signal = SignalKind::spectral, .eigenfunctions = 64, .width = 32}, 5, rest.context,
      test::signal_of(SignalKind::spectral, rest, target, 24), size));
}
// One that stretches what it does not know.
Net wild() { return awake(0.5); }

class Refine : public ::testing::Test {
 protected:
  // Prepared once: most of the time goes there.
  static void SetUpTestSuite() {
    const zoo::Mesh mesh = zoo::perturbed_sphere(3, 3);
    from = prepared(mesh);
    to = prepared(test::bent(mesh.vertices), mesh.faces);
  }
  static void TearDownTestSuite() {
    from.reset();
    to.reset();
  }
  static inline Prepared from, to;

  zoo::Mesh source = zoo::perturbed_sphere(3, 3);
  Points bent = test::bent(source.vertices);
  Eigen::Index n = source.vertices.rows();
  Eigen::VectorXi rough = noisy_identity(source, 4);
};

TEST_F(Refine, KeepsTheIdentityOfAMeshToItself) {
  const RefineResult got = Refiner(from, from, nullptr, kRounds).refine(identity(n));
  EXPECT_GT(share_equal(got.point_map, identity(n)), 0.99);
  EXPECT_GT(got.confidence.minCoeff(), 0.5);
  EXPECT_LE(got.confidence.maxCoeff(), 1.0);
  EXPECT_LT(test::farthest(got.recovered, source.vertices), 0.03 * test::diagonal(source.vertices));
}

TEST_F(Refine, BringsARoughMapNearerToTheTruth) {
  for (const Net& network : {Net(), awake()}) {
    const RefineResult got = Refiner(from, to, network, kRounds).refine(rough);
    EXPECT_LT(apart(bent, got.point_map, identity(n)), 0.4 * apart(bent, rough, identity(n)));
    EXPECT_EQ(got.report.rounds, 2);
    EXPECT_EQ(got.report.network, network != nullptr);
  }
}

TEST_F(Refine, TornMapsDoNotRunAway) {
  // Two caps that go to each other's places, and a tenth of all vertices anywhere.
  std::mt19937 random(6);
  Eigen::VectorXi torn = identity(n);
  const Eigen::VectorXd height = source.vertices.col(2);
  for (Eigen::Index i = 0; i < n; ++i) {
    if (std::abs(height[i]) > 0.7 || random() % 10 == 0) {
      torn[i] = static_cast<int>(random() % static_cast<unsigned>(n));
    }
  }
  for (const Net& network : {Net(), wild()}) {
    const RefineResult got =
        Refiner(from, to, network, {.counts = {40, 60, 60, 60, 60, 60}}).refine(torn);
    EXPECT_LT(test::diagonal(got.recovered), 2.0 * test::diagonal(bent));
    EXPECT_LT(apart(bent, got.point_map, identity(n)), apart(bent, torn, identity(n)));
    EXPECT_EQ(got.report.bounded_faces > 0, network != nullptr);
  }
  EXPECT_EQ(Refiner(from, to, awake(), kRounds).refine(rough).report.bounded_faces, 0);
}

TEST_F(Refine, LaysTheSourceOntoTheTargetInTheTargetsUnits) {
  const Points far = (20.0 * bent).rowwise() + Eigen::RowVector3d(3.0, -5.0, 100.0);
  const Prepared distant = prepared(far, source.faces);
  const RefineResult got = Refiner(from, distant, nullptr, kRounds).refine(rough);
  EXPECT_LT(test::farthest(got.recovered, far), 0.1 * test::diagonal(far));
  const Points on = apply(got.surface_map, source.faces, far);
  EXPECT_LT(test::farthest(got.recovered, on), 0.03 * test::diagonal(far));
}

TEST_F(Refine, IsTheSameForTurnedAndScaledMeshes) {
  const Net network = awake();
  const Eigen::VectorXi expected = Refiner(from, to, network, kRounds).refine(rough).point_map;
  for (uint64_t which = 0; which < 2; ++which) {
    const Points turned = 3.0 * (source.vertices * test::rotation(which));
    const Points other =
        (0.01 * (bent * test::rotation(which + 3))).rowwise() + Eigen::RowVector3d(1.0, 2.0, 3.0);
    const RefineResult got =
        Refiner(prepared(turned, source.faces), prepared(other, source.faces), network, kRounds)
            .refine(rough);
    EXPECT_GT(share_equal(got.point_map, expected), 0.99) << "rotation " << which;
  }
}

TEST_F(Refine, IsTheSameForAnyOrderOfVertices) {
  std::vector<int> order(static_cast<size_t>(n));
  std::iota(order.begin(), order.end(), 0);
  std::shuffle(order.begin(), order.end(), std::mt19937(1));
  Points shuffled(n, 3);
  Eigen::VectorXi place(n);
  for (int i = 0; i < n; ++i) {
    place[i] = order[static_cast<size_t>(i)];
    shuffled.row(place[i]) = source.vertices.row(i);
  }
  Faces faces = source.faces;
  faces = faces.unaryExpr([&](int v) { return place[v]; }).eval();
  Eigen::VectorXi map(n);
  for (int i = 0; i < n; ++i) {
    map[place[i]] = rough[i];
  }
  const Eigen::VectorXi expected = Refiner(from, to, nullptr, kRounds).refine(rough).point_map;
  const RefineResult got = Refiner(prepared(shuffled, faces), to, nullptr, kRounds).refine(map);
  EXPECT_GT(share_equal(got.point_map(place), expected), 0.99);
}

TEST_F(Refine, UnusedVerticesAndFacesWithoutAreaChangeNothing) {
  const Eigen::VectorXi expected = Refiner(from, to, nullptr, kRounds).refine(rough).point_map;
  // Unused copies of all vertices behind the used ones, on both sides.
  const auto doubled = [](const Points& vertices) {
    Points twice(2 * vertices.rows(), 3);
    twice << vertices, vertices;
    return twice;
  };
  const Prepared more = prepared(doubled(source.vertices), source.faces);
  const Prepared other = prepared(doubled(bent), source.faces);
  Eigen::VectorXi map(2 * n);
  map << rough.array() + static_cast<int>(n), rough;  // first half: to unused copies
  const RefineResult got = Refiner(more, other, nullptr, kRounds).refine(map);
  EXPECT_EQ(got.point_map.head(n), expected);
  EXPECT_EQ(got.point_map.tail(n), expected);
  EXPECT_LT(test::farthest(got.recovered.topRows(n), got.recovered.bottomRows(n)), 1e-9);
}

TEST_F(Refine, StartsFromPointsInsideTrianglesToo) {
  const Refiner refiner(from, to, nullptr, kRounds);
  const RefineResult expected = refiner.refine(rough);
  const RefineResult got = refiner.refine(surface_map(rough, source.faces, n));
  EXPECT_EQ(got.point_map, expected.point_map);
  const RefineResult again = refiner.refine(expected.surface_map);
  EXPECT_LT(apart(bent, again.point_map, identity(n)), 0.4 * apart(bent, rough, identity(n)));
}

TEST_F(Refine, GivesTheWayBack) {
  RefineOptions options = kRounds;
  options.backward = true;
  const RefineResult got = Refiner(from, to, nullptr, options).refine(rough);
  ASSERT_EQ(got.backward_point_map.size(), n);
  EXPECT_LT(apart(source.vertices, got.backward_point_map, identity(n)),
            apart(source.vertices, rough, identity(n)));
  check_surface_map(got.backward_surface_map, n, source.faces);
}

TEST_F(Refine, SpectralProjectionIsTheMapOfTheFunctionalMap) {
  const RefineOptions options{.method = RefineMethod::spectral_projection, .counts = {40}};
  const Eigen::Index count = stable_count(from->basis, to->basis, 40);
  EXPECT_EQ(Refiner(from, to, awake(), options).refine(rough).point_map,
            point_map(from->basis, to->basis,
                      functional_map(from->basis, to->basis, rough, count, count)));
}

TEST_F(Refine, ConfidenceIsLowWhereTheMapIsWrong) {
  // Half of the sphere collapses onto one vertex.
  Eigen::VectorXi collapsed = identity(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    if (source.vertices(i, 0) > 0.0) {
      collapsed[i] = 0;
    }
  }
  const Prepared& mesh = from;
  const Refiner refiner(mesh, mesh, nullptr, kRounds);
  EXPECT_LT(refiner.refine(collapsed).confidence.mean(),
            0.8 * refiner.refine(identity(n)).confidence.mean());
}

TEST_F(Refine, NotesWhatAMapCannotRespect) {
  const Prepared one = from, two = prepared(zoo::two_spheres(2));
  const Prepared open = prepared(zoo::open_cylinder(24, 12));
  const auto codes = [](const Refiner& refiner) {
    std::vector<std::string> result;
    for (const Note& note : refiner.notes()) {
      result.push_back(note.code);
    }
    return result;
  };
  using Codes = std::vector<std::string>;
  EXPECT_EQ(codes(Refiner(one, one, nullptr, kRounds)), Codes{});
  EXPECT_EQ(codes(Refiner(two, one, nullptr, kRounds)), Codes{"components_differ"});
  EXPECT_EQ(codes(Refiner(open, one, nullptr, kRounds)), Codes{"boundaries_differ"});
  EXPECT_EQ(codes(Refiner(one, one, nullptr, {.counts = {500}})), Codes{"fewer_eigenfunctions"});
  // And it works all the same.
  const Eigen::VectorXi map = Eigen::VectorXi::Zero(two->mesh.vertices().rows());
  EXPECT_TRUE(Refiner(two, one, nullptr, kRounds).refine(map).recovered.allFinite());
}

TEST_F(Refine, SaysWhatIsWrongWithTheInput) {
  const Prepared& mesh = from;
  const Refiner refiner(mesh, mesh, nullptr, kRounds);
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"3 entries", std::to_string(n).c_str()},
                               [&] { refiner.refine(identity(3)); }));
  Eigen::VectorXi beyond = identity(n);
  beyond[7] = static_cast<int>(n);
  EXPECT_TRUE(test::fails_with(ErrorCode::index_out_of_range, {"vertex 7"},
                               [&] { refiner.refine(beyond); }));
  beyond[7] = -1;
  EXPECT_TRUE(test::fails_with(ErrorCode::index_out_of_range, {"vertex 7", "-1"},
                               [&] { refiner.refine(beyond); }));
  SurfaceMap nowhere = surface_map(identity(n), source.faces, n);
  nowhere.face[5] = -1;
  EXPECT_TRUE(test::fails_with(ErrorCode::index_out_of_range, {"vertex 5", "no face"},
                               [&] { refiner.refine(nowhere); }));
  const auto refuses = [&](const RefineOptions& options, const char* part) {
    EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {part},
                                 [&] { Refiner(mesh, mesh, nullptr, options); }));
  };
  refuses({.counts = {}}, "at least one round");
  refuses({.counts = {0}}, "at least 1 eigenfunction");
  refuses({.settling_rounds = -1}, "-1 settling");
  refuses({.facing = 2.0}, "facing");
  refuses({.recovery = {.pull = -1.0}}, "pull");
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"rotations"}, [&] {
    Refiner(mesh, mesh,
            std::make_shared<const LocalJacobianNetwork<float>>(
                Architecture{.signal = SignalKind::rotation, .eigenfunctions = 64, .width = 32}, 1),
            kRounds);
  }));
}

TEST_F(Refine, StopsWhenAsked) {
  const Prepared& mesh = from;
  Progress progress;
  progress.cancel();
  EXPECT_TRUE(test::fails_with(ErrorCode::cancelled, {}, [&] {
    Refiner(mesh, mesh, nullptr, kRounds).refine(identity(n), ProgressRange(&progress));
  }));
}

TEST_F(Refine, LiteralFormRefinesToo) {
  RefineOptions options = kRounds;
  options.recovery.form = RecoveryForm::literal;
  const RefineResult got = Refiner(from, to, nullptr, options).refine(rough);
  EXPECT_LT(apart(bent, got.point_map, identity(n)), apart(bent, rough, identity(n)));
}

}  // namespace
}  // namespace supple
