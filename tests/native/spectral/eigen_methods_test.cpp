// SPDX-License-Identifier: GPL-3.0-or-later
// Every way to find eigenfunctions against the others, and against what is known.
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <initializer_list>
#include <string>
#include <thread>
#include <vector>

#include "native/support.h"
#include "spectral/eigenproblem.h"
#include "supple/geometry/operators.h"
#include "supple/geometry/surface_operators.h"
#include "supple/spectral/eigenbasis.h"

namespace supple {
namespace {

// Of small meshes too, on which `multiresolution` is `block_krylov`.
constexpr EigenMethod kIterative[] = {EigenMethod::block_krylov, EigenMethod::lanczos};

// Laplacian and mass of a mesh in its own units: copies of a piece give the same numbers.
struct Problem {
  explicit Problem(const zoo::Mesh& mesh)
      : laplacian(cotan_laplacian(mesh.vertices, mesh.faces)),
        mass(lumped_mass(mesh.vertices, mesh.faces)) {}
  Eigenbasis solve(int count, EigenMethod method) const {
    return eigenbasis(laplacian, mass, {.count = count, .method = method});
  }
  // Every eigenvalue, by Eigen.
  Eigen::VectorXd all_values() const {
    const Eigen::MatrixXd w = laplacian, m = mass.asDiagonal();
    return Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd>(w, m, Eigen::EigenvaluesOnly)
        .eigenvalues()
        .cwiseMax(0.0);
  }
  SparseMatrix laplacian;
  Eigen::VectorXd mass;
};

// A torus bent out of every symmetry: no eigenvalue twice. 66 vertices.
zoo::Mesh plain_piece() {
  zoo::Mesh mesh = zoo::torus(11, 6);
  mesh.vertices = test::bent(mesh.vertices);
  return mesh;
}

zoo::Mesh copies(const zoo::Mesh& piece, int count, double growth = 0.0) {
  zoo::Mesh result{Points(piece.vertices.rows() * count, 3), Faces(piece.faces.rows() * count, 3)};
  for (int i = 0; i < count; ++i) {
    // Moved by nothing: the coordinates keep their last bit, and no geometry is looked at.
    result.vertices.middleRows(piece.vertices.rows() * i, piece.vertices.rows()) =
        piece.vertices * (1.0 + growth * i);
    result.faces.middleRows(piece.faces.rows() * i, piece.faces.rows()) =
        piece.faces.array() + static_cast<int>(piece.vertices.rows()) * i;
  }
  return result;
}

Eigen::VectorXd repeated(const Eigen::VectorXd& values, int copies, int count) {
  Eigen::VectorXd result(count);
  for (int i = 0; i < count; ++i) {
    result[i] = values[i / copies];
  }
  return result;
}

// What is promised whatever the method: orthonormal, ascending, and the residual that is stated.
void expect_sound(const Problem& problem, const Eigenbasis& basis, double residual) {
  const Eigen::MatrixXd gram =
      basis.functions.transpose() * basis.mass.asDiagonal() * basis.functions;
  EXPECT_LT((gram - Eigen::MatrixXd::Identity(gram.rows(), gram.cols())).cwiseAbs().maxCoeff(),
            1e-8);
  double worst = 0.0;
  for (Eigen::Index k = 0; k < basis.size(); ++k) {
    const Eigen::VectorXd phi = basis.functions.col(k);
    const Eigen::VectorXd r =
        problem.laplacian * phi - basis.values[k] * problem.mass.cwiseProduct(phi);
    worst = std::max(
        worst, r.cwiseQuotient(problem.mass.cwiseSqrt()).norm() / std::max(basis.values[k], 1.0));
    if (k > 0) {
      EXPECT_LE(basis.values[k - 1], basis.values[k]);
    }
  }
  EXPECT_LE(worst, residual);
  EXPECT_NEAR(worst, basis.residual, 1e-3 * residual) << "the residual it states is not its own";
}

void expect_values(const Eigen::VectorXd& got, const Eigen::VectorXd& expected, double relative,
                   const std::string& what) {
  ASSERT_EQ(got.size(), expected.size()) << what;
  for (Eigen::Index k = 0; k < got.size(); ++k) {
    ASSERT_NEAR(got[k], expected[k], relative * std::max(expected[k], 1.0))
        << what << ": eigenvalue " << k << " of " << got.size();
  }
}

double residual_of(EigenMethod method) {
  return method == EigenMethod::multiresolution ? 1e-2 : 1e-8;
}
// What the residual promises (Weyl): an eigenvalue that near. Far from others the error goes with
// its square, hence the 1e-3 below.
double value_error(EigenMethod method) { return residual_of(method); }

TEST(EigenMethods, NamesComeBack) {
  for (const EigenMethod method :
       {EigenMethod::automatic, EigenMethod::block_krylov, EigenMethod::multiresolution,
        EigenMethod::lanczos, EigenMethod::dense}) {
    EXPECT_EQ(eigen_method(to_string(method)), method) << to_string(method);
  }
  for (const char* name : {"", "Lanczos", "block-krylov", "dense "}) {
    EXPECT_TRUE(test::fails_with(
        ErrorCode::bad_option,
        {name, "'automatic'", "'block_krylov'", "'multiresolution'", "'lanczos'", "'dense'"},
        [&] { eigen_method(name); }));
  }
}

TEST(EigenMethods, AutomaticNamesTheOneItUsed) {
  const Problem problem(zoo::perturbed_sphere(2, 7));  // 162 vertices
  EXPECT_EQ(problem.solve(20, EigenMethod::automatic).method, EigenMethod::block_krylov);
  EXPECT_EQ(problem.solve(30, EigenMethod::automatic).method, EigenMethod::dense);
  EXPECT_EQ(problem.solve(30, EigenMethod::lanczos).method, EigenMethod::dense);
  EXPECT_EQ(problem.solve(20, EigenMethod::dense).method, EigenMethod::dense);
  EXPECT_EQ(problem.solve(20, EigenMethod::lanczos).method, EigenMethod::lanczos);
  // A coarse space of some 25 dimensions has no room for 20 functions.
  EXPECT_EQ(problem.solve(20, EigenMethod::multiresolution).method, EigenMethod::block_krylov);
  const Problem large(zoo::perturbed_sphere(5, 7));  // 10242
  EXPECT_EQ(large.solve(9, EigenMethod::automatic).method, EigenMethod::block_krylov);
  EXPECT_EQ(large.solve(9, EigenMethod::multiresolution).method, EigenMethod::multiresolution);
}

TEST(EigenMethods, AgreeWithAllEigenvalues) {
  for (const zoo::Mesh& mesh : {zoo::perturbed_sphere(3, 7), zoo::icosphere(3), zoo::torus(24, 14),
                                zoo::grid(20, 20, 0.04), zoo::moebius(80, 4)}) {
    const Problem problem(mesh);
    const Eigen::VectorXd expected = problem.all_values();
    for (const int count : {1, 16, 60}) {
      for (const EigenMethod method :
           {EigenMethod::block_krylov, EigenMethod::lanczos, EigenMethod::dense}) {
        SCOPED_TRACE(std::to_string(mesh.vertices.rows()) + " vertices, " + to_string(method));
        const Eigenbasis basis = problem.solve(count, method);
        expect_values(basis.values, expected.head(count), value_error(basis.method),
                      std::to_string(count) + " functions");
        expect_sound(problem, basis, residual_of(basis.method));
      }
    }
  }
}

TEST(EigenMethods, SlowMultiresolutionAgreesOnTenThousandVertices) {
  zoo::Mesh bent = zoo::torus(180, 100);
  bent.vertices = test::bent(bent.vertices);
  for (const zoo::Mesh& mesh :
       {zoo::perturbed_sphere(5, 7), zoo::icosphere(5), zoo::grid(140, 120, 0.04), bent}) {
    const Problem problem(mesh);
    for (const int count : {2, 9, 20}) {
      const Eigenbasis exact = problem.solve(count, EigenMethod::block_krylov);
      const Eigenbasis basis = problem.solve(count, EigenMethod::multiresolution);
      EXPECT_EQ(basis.method, EigenMethod::multiresolution)
          << mesh.vertices.rows() << " vertices, " << count << " functions";
      expect_values(basis.values, exact.values, 1e-3, std::to_string(mesh.vertices.rows()));
      expect_sound(problem, basis, 1e-2);
      // Asked for more, it gives more.
      const Eigenbasis fine = eigenbasis(
          problem.laplacian, problem.mass,
          {.count = count, .method = EigenMethod::multiresolution, .coarse_residual = 1e-3});
      expect_values(fine.values, exact.values, 1e-4, std::to_string(mesh.vertices.rows()));
      expect_sound(problem, fine, 1e-3);
    }
  }
}

// With too few vertices for a coarse space, down to those that the dense way takes.
TEST(EigenMethods, MultiresolutionOfAMeshHardlyLargeEnough) {
  const Problem problem(zoo::perturbed_sphere(3, 7));  // 642 vertices
  const Eigen::VectorXd expected = problem.all_values();
  for (const int count : {1, 2, 3, 4, 5, 8, 60, 80, 90, 110, 144}) {
    const Eigenbasis basis = problem.solve(count, EigenMethod::multiresolution);
    expect_values(basis.values, expected.head(count), value_error(basis.method),
                  std::to_string(count));
  }
}

TEST(EigenMethods, SlowMultiresolutionOfThirtyThousandVertices) {
  zoo::Mesh mesh = zoo::torus(250, 120);
  mesh.vertices = test::bent(mesh.vertices);
  const Problem problem(mesh);
  const Eigenbasis exact = problem.solve(128, EigenMethod::block_krylov);
  expect_sound(problem, exact, 1e-8);
  const Eigenbasis basis = problem.solve(128, EigenMethod::multiresolution);
  ASSERT_EQ(basis.method, EigenMethod::multiresolution);
  expect_values(basis.values, exact.values, 1e-3, "128");
  expect_sound(problem, basis, 1e-2);
}

// --- multiple eigenvalues
// -------------------------------------------------------------------------

class IdenticalPieces : public ::testing::TestWithParam<EigenMethod> {};

TEST_P(IdenticalPieces, SlowEveryEigenvalueAsOftenAsThereArePieces) {
  for (const zoo::Mesh& piece : {plain_piece(), zoo::icosphere(1)}) {
    const Eigen::VectorXd single = Problem(piece).all_values();
    for (const int pieces : {12, 20, 40}) {
      const Problem problem(copies(piece, pieces));
      for (const int count : {64, 129}) {
        SCOPED_TRACE(std::to_string(pieces) + " pieces of " +
                     std::to_string(piece.vertices.rows()) + ", " + std::to_string(count));
        const Eigenbasis basis = problem.solve(count, GetParam());
        if (count > problem.mass.size()) {
          continue;
        }
        expect_values(basis.values, repeated(single, pieces, count), value_error(basis.method),
                      to_string(basis.method));
        expect_sound(problem, basis, residual_of(basis.method));
      }
    }
  }
}

void expect_every_copy(std::initializer_list<int> counts) {
  zoo::Mesh piece = zoo::torus(48, 24);
  piece.vertices = test::bent(piece.vertices);
  const Eigen::VectorXd single = Problem(piece).solve(20, EigenMethod::block_krylov).values;
  for (const int pieces : counts) {
    const Problem problem(copies(piece, pieces));
    for (const int count : {pieces + 2, pieces == 2 ? 20 : 2 * pieces + 7}) {
      SCOPED_TRACE(std::to_string(pieces) + " pieces, " + std::to_string(count));
      const Eigenbasis basis = problem.solve(count, EigenMethod::multiresolution);
      EXPECT_EQ(basis.method,
                count == 20 ? EigenMethod::block_krylov : EigenMethod::multiresolution)
          << "two pieces have too few vertices for 20 functions";
      expect_values(basis.values, repeated(single, pieces, count), value_error(basis.method),
                    std::to_string(pieces) + " pieces");
      expect_sound(problem, basis, residual_of(basis.method));
    }
  }
}

TEST(EigenMethods, MultiresolutionFindsEveryCopy) { expect_every_copy({2, 12}); }
TEST(EigenMethods, SlowMultiresolutionFindsEveryCopyOfMany) { expect_every_copy({20, 40}); }

TEST(EigenMethods, MultiresolutionOfABigPieceBesideTinyOnes) {
  zoo::Mesh mesh = zoo::perturbed_sphere(5, 7);
  for (int i = 0; i < 3; ++i) {
    mesh = zoo::joined(mesh, zoo::moved(zoo::icosphere(1), {4.0 + 2.0 * i, 0, 0}, 0.01));
  }
  const Problem problem(mesh);
  const Eigenbasis exact = problem.solve(12, EigenMethod::block_krylov);
  const Eigenbasis basis = problem.solve(12, EigenMethod::multiresolution);
  ASSERT_EQ(basis.method, EigenMethod::multiresolution);
  expect_values(basis.values, exact.values, 1e-3, "12");
  expect_sound(problem, basis, 1e-2);
}

// Copies that differ by more than rounding and less than anything a block can tell apart.
TEST_P(IdenticalPieces, NearlyIdenticalOnesToo) {
  const zoo::Mesh piece = plain_piece();
  const Eigen::VectorXd single = Problem(piece).all_values();
  for (const double growth : {1e-10, 1e-8, 1e-6}) {
    const int pieces = 20, count = 64;
    const Problem problem(copies(piece, pieces, growth));
    const Eigenbasis basis = problem.solve(count, GetParam());
    std::vector<double> expected;
    for (int k = 0; k < 10; ++k) {
      for (int i = 0; i < pieces; ++i) {
        expected.push_back(single[k] / ((1.0 + growth * i) * (1.0 + growth * i)));
      }
    }
    std::sort(expected.begin(), expected.end());
    expect_values(basis.values, Eigen::VectorXd::Map(expected.data(), count),
                  value_error(basis.method), "growth " + std::to_string(growth));
  }
}

TEST_P(IdenticalPieces, SlowMorePiecesThanAnyNumberOfSearches) {
  const zoo::Mesh piece = plain_piece();
  const Eigen::VectorXd single = Problem(piece).all_values();
  const Problem problem(copies(piece, 100));
  const Eigenbasis basis = problem.solve(300, GetParam());
  expect_values(basis.values, repeated(single, 100, 300), value_error(basis.method),
                to_string(basis.method));
}

TEST_P(IdenticalPieces, MoreComponentsThanFunctions) {
  const Problem problem(copies(plain_piece(), 40));
  const Eigenbasis basis = problem.solve(30, GetParam());
  ASSERT_EQ(basis.size(), 30);
  EXPECT_LT(basis.values.maxCoeff(), 1e-8);
  expect_sound(problem, basis, 1e-8);
}

// A tiny piece's eigenvalues are far up; it adds a zero and nothing else.
TEST_P(IdenticalPieces, TinyPiecesBesideABigOneOnlyAddZeros) {
  const zoo::Mesh big = zoo::perturbed_sphere(3, 7);
  zoo::Mesh mesh = big;
  for (int i = 0; i < 5; ++i) {
    mesh = zoo::joined(mesh, zoo::moved(zoo::tetrahedron(), {3.0, 0.1 * i, 0.0}, 1e-3));
  }
  const Eigen::VectorXd expected = Problem(big).all_values();
  const Problem problem(mesh);
  const Eigenbasis basis = problem.solve(40, GetParam());
  EXPECT_LT(basis.values[5], 1e-8);
  expect_values(basis.values.tail(35), expected.head(35), value_error(basis.method),
                to_string(basis.method));
  // The big piece's constant is among the kernel's functions, also where few are asked for.
  const Eigenbasis one = problem.solve(1, GetParam());
  const Eigen::VectorXd head = one.functions.col(0).head(big.vertices.rows());
  EXPECT_LT(head.maxCoeff() - head.minCoeff(), 1e-8 * std::abs(head.mean()));
}

INSTANTIATE_TEST_SUITE_P(Methods, IdenticalPieces, ::testing::ValuesIn(kIterative),
                         [](const auto& info) { return to_string(info.param); });

// --- kernel
// ---------------------------------------------------------------------------------------

TEST(EigenproblemKernel, IsOneConstantAComponentLargestFirst) {
  const zoo::Mesh big = zoo::icosphere(2), small = zoo::moved(zoo::icosphere(1), {5, 0, 0}, 0.3),
                  middle = zoo::moved(zoo::cube(), {9, 0, 0}, 0.7);
  const Problem problem(zoo::joined(zoo::joined(small, big), middle));
  const Eigenproblem solver(problem.laplacian, problem.mass, nullptr);
  ASSERT_EQ(solver.kernel_size(), 3);
  const RowMatrix<double> kernel = solver.kernel(10);
  ASSERT_EQ(kernel.cols(), 3);
  EXPECT_LT((solver.symmetric() * kernel).norm(), 1e-11);
  EXPECT_LT((kernel.transpose() * kernel - Eigen::Matrix3d::Identity()).norm(), 1e-13);
  EXPECT_EQ(solver.kernel(1), kernel.leftCols(1));
  // 42 vertices of the small, 162 of the big, 8 of the middle one.
  EXPECT_GT(kernel.col(0).segment(42, 162).norm(), 0.99);
  EXPECT_GT(kernel.col(1).tail(8).norm(), 0.99);
  EXPECT_GT(kernel.col(2).head(42).norm(), 0.99);

  RowMatrix<double> block = test::noise(212, 6, 1);
  const RowMatrix<double> projected = block - kernel * (kernel.transpose() * block);
  solver.leave_kernel(block);
  EXPECT_LT((block - projected).norm(), 1e-12 * projected.norm());
}

TEST(EigenproblemInverse, UndoesThePencil) {
  const Problem problem(zoo::perturbed_sphere(2, 7));
  const Eigenproblem solver(problem.laplacian, problem.mass, nullptr);
  const RowMatrix<double> x = test::noise(162, 5, 1);
  const RowMatrix<double> there = solver.symmetric() * x + solver.shift() * x;
  EXPECT_LT((solver.inverse(there) - x).norm(), 1e-11 * x.norm());
}

TEST(Eigenbasis, OneAnalysisServesTheBasisToo) {
  const Problem problem(zoo::perturbed_sphere(3, 7));
  const auto shared = std::make_shared<const SymbolicCholesky>(problem.laplacian);
  for (const EigenMethod method : kIterative) {
    const EigenbasisOptions options{.count = 24, .method = method};
    const Eigenbasis with = eigenbasis(problem.laplacian, problem.mass, options, {}, shared),
                     without = eigenbasis(problem.laplacian, problem.mass, options);
    EXPECT_EQ(with.values, without.values) << to_string(method);
    EXPECT_EQ(with.functions, without.functions) << to_string(method);
  }
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"162", "642"}, [&] {
    const Problem other(zoo::perturbed_sphere(2, 7));
    eigenbasis(other.laplacian, other.mass, {.count = 5}, {}, shared);
  }));
}

// --- cancelling, slivers
// --------------------------------------------------------------------------

TEST(EigenMethodsCancel, WhereverAMethodReports) {
  const Problem small(zoo::perturbed_sphere(3, 7)), large(zoo::perturbed_sphere(5, 7));
  for (const EigenMethod method : {EigenMethod::block_krylov, EigenMethod::lanczos,
                                   EigenMethod::multiresolution, EigenMethod::dense}) {
    const bool coarse = method == EigenMethod::multiresolution;
    const Problem& problem = coarse ? large : small;
    for (const double from : {0.0, 0.1, 0.3, 0.5}) {
      Progress progress;
      std::thread watcher([&] {
        while (progress.fraction() <= from) {
          std::this_thread::yield();
        }
        progress.cancel();
      });
      // Until it is: who is faster does not matter.
      EXPECT_TRUE(test::fails_with(ErrorCode::cancelled, {},
                                   [&] {
                                     for (;;) {
                                       eigenbasis(problem.laplacian, problem.mass,
                                                  {.count = coarse ? 9 : 40, .method = method},
                                                  ProgressRange(&progress));
                                     }
                                   }))
          << to_string(method) << " from " << from;
      watcher.join();
    }
  }
}

class EigenMethodsZoo : public ::testing::TestWithParam<zoo::Entry> {};

TEST_P(EigenMethodsZoo, AgreeWhereTheMeshIsLargeEnough) {
  const SurfaceOperators operators{TriangleMesh(GetParam().mesh.vertices, GetParam().mesh.faces)};
  for (const int count : {3, 8, 18}) {
    const auto solve = [&](EigenMethod method) {
      return eigenbasis(operators.laplacian, operators.mass, {.count = count, .method = method});
    };
    const Eigenbasis exact = solve(EigenMethod::dense);
    for (const EigenMethod method : kIterative) {
      const Eigenbasis basis = solve(method);
      expect_values(basis.values, exact.values, value_error(basis.method), to_string(basis.method));
    }
  }
}

SUPPLE_OVER_THE_ZOO(EigenMethodsZoo);

// The space ends long before there are enough dimensions, and random columns take the place of what
// is lost, a block at a time.
TEST(EigenMethods, SlowManyCopiesOfAPieceWithFewEigenvalues) {
  const Problem problem(copies(plain_piece(), 100));
  const Eigenbasis basis = problem.solve(250, EigenMethod::block_krylov);
  const Eigen::MatrixXd gram =
      basis.functions.transpose() * basis.mass.asDiagonal() * basis.functions;
  EXPECT_LT((gram - Eigen::MatrixXd::Identity(gram.rows(), gram.cols())).cwiseAbs().maxCoeff(),
            1e-9);
  EXPECT_LT(basis.residual, 1e-8);
}

TEST(EigenMethods, SlowSlivers) {
  const zoo::Mesh even = zoo::perturbed_sphere(5, 3);
  const zoo::Mesh two = zoo::joined(even, zoo::moved(even, {4, 0, 0}, 1.1));
  for (const double thinness : {1e-2, 1e-4, 1e-6}) {
    const zoo::Mesh mesh = zoo::with_slivers(two, thinness);
    const SurfaceOperators operators{TriangleMesh(mesh.vertices, mesh.faces)};
    const auto solve = [&](EigenMethod method) {
      return eigenbasis(operators.laplacian, operators.mass, {.count = 30, .method = method});
    };
    const Eigenbasis exact = solve(EigenMethod::lanczos);
    for (const EigenMethod method : {EigenMethod::block_krylov, EigenMethod::multiresolution}) {
      const Eigenbasis basis = solve(method);
      ASSERT_EQ(basis.method, method);
      expect_values(basis.values, exact.values, value_error(method) + exact.residual,
                    std::string(to_string(method)) + ", thinness " + std::to_string(thinness));
    }
  }
}

}  // namespace
}  // namespace supple
