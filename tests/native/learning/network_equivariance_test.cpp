// SPDX-License-Identifier: GPL-3.0-or-later
// Turning the source by R1 and the target by R2 takes the network's Jacobians to R1^T J R2.
#include <tuple>

#include "native/learning/networks.h"

namespace supple {
namespace {

using Kind = std::tuple<zoo::Entry, SignalKind>;

MatrixField turned(const MatrixField& field, const Matrix3& r1, const Matrix3& r2) {
  MatrixField result(field.rows(), 9);
  for (Eigen::Index f = 0; f < field.rows(); ++f) {
    matrix_at(result, f) = r1.transpose() * matrix_at(field, f) * r2;
  }
  return result;
}

class Equivariance : public ::testing::TestWithParam<Kind> {
 protected:
  static constexpr int kEigenfunctions = 64;
  const zoo::Mesh& mesh() const { return std::get<0>(GetParam()).mesh; }
  SignalKind kind() const { return std::get<1>(GetParam()); }
  Architecture architecture() const {
    return {.signal = kind(), .eigenfunctions = kEigenfunctions, .width = 32};
  }
};

template <class Scalar>
void expect_turned(const zoo::Mesh& mesh, const Architecture& architecture, double strength,
                   double tolerance, Eigen::Index samples = 200) {
  const int functions = architecture.eigenfunctions;
  const test::RestMesh<Scalar> rest(mesh, functions, samples);
  const Points target = test::bent(rest.operators.vertices);
  const Signal signal = test::signal_of(architecture.signal, rest, target, 30);
  const auto network = test::awake_network<Scalar>(architecture, 5, rest.context, signal, strength);
  const MatrixField answer = network.forward(rest.context, signal);
  ASSERT_GT((answer - signal.fields.back()).norm(), 1e-3 * answer.norm()) << "network asleep";
  for (uint64_t which = 0; which < 3; ++which) {
    const Matrix3 r1 = test::rotation(which), r2 = test::rotation(which + 3);
    const test::RestMesh<Scalar> other({mesh.vertices * r1, mesh.faces}, functions, samples);
    const Signal other_signal = test::signal_of(architecture.signal, other, target * r2, 30);
    const MatrixField expected = turned(answer, r1, r2);
    const MatrixField got = network.forward(other.context, other_signal);
    EXPECT_LT((got - expected).norm(), tolerance * expected.norm()) << "rotation " << which;
  }
}

// The mathematics: what is left is rounding of the eigenfunctions.
TEST_P(Equivariance, InDouble) { expect_turned<double>(mesh(), architecture(), 0.2, 1e-6); }
TEST_P(Equivariance, InDoubleAtEveryVertex) {
  expect_turned<double>(mesh(), architecture(), 0.2, 1e-6, 0);
}
// The precision of use. Random weights magnify rounding more than trained ones, so they are weak.
TEST_P(Equivariance, InFloat) { expect_turned<float>(mesh(), architecture(), 0.05, 1e-4); }

std::vector<zoo::Entry> shapes() {
  return {{.name = "irregular", .mesh = zoo::perturbed_sphere(3, 2)},
          {.name = "icosphere", .mesh = zoo::icosphere(3)},
          {.name = "square_tower", .mesh = zoo::square_tower(3, 9)},
          {.name = "torus", .mesh = zoo::torus(24, 14)},
          {.name = "cylinder", .mesh = zoo::open_cylinder(20, 14)},
          {.name = "two_spheres", .mesh = zoo::two_spheres(2)},
          {.name = "many_pieces", .mesh = zoo::many_pieces(12)},
          {.name = "few_vertices", .mesh = zoo::cube()}};
}
INSTANTIATE_TEST_SUITE_P(Shapes, Equivariance,
                         ::testing::Combine(::testing::ValuesIn(shapes()),
                                            ::testing::Values(SignalKind::rotation,
                                                              SignalKind::spectral)),
                         [](const auto& info) {
                           return std::get<0>(info.param).name + "_" +
                                  to_string(std::get<1>(info.param));
                         });

class OneRotation : public ::testing::TestWithParam<zoo::Entry> {};

TEST_P(OneRotation, ComesBackAsItIs) {
  const test::RestMesh<float> rest(GetParam().mesh, 64, 200);
  const Signal bent_signal =
      test::signal_of(SignalKind::rotation, rest, test::bent(rest.operators.vertices));
  const auto network =
      test::awake_network<float>({.eigenfunctions = 64, .width = 32}, 5, rest.context, bent_signal);
  const Signal signal =
      test::signal_of(SignalKind::rotation, rest, rest.operators.vertices * test::rotation(2));
  const MatrixField change = network.forward(rest.context, signal) - signal.fields.back();
  EXPECT_LT(change.cwiseAbs().maxCoeff(), 1e-4);
}

INSTANTIATE_TEST_SUITE_P(Shapes, OneRotation, ::testing::ValuesIn(shapes()), test::entry_name);

}  // namespace
}  // namespace supple
