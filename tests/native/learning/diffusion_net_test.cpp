// SPDX-License-Identifier: GPL-3.0-or-later
// What the DiffusionNet's features depend on, and what not.
#include "supple/learning/diffusion_net.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "native/learning/diffusion_nets.h"
#include "supple/geometry/tangent_gradient.h"

namespace supple {
namespace {

constexpr int kFunctions = 30;
const DiffusionSizes kSizes{.inputs = 8, .outputs = 6, .width = 10, .blocks = 2};

constexpr double kStrength = 40.0;  // wave kernels vary little over an egg

template <class Scalar>
DiffusionParameters<Scalar> awake() {
  return test::awake_diffusion_net<Scalar>(kSizes, 5, kStrength);
}

// An egg bent to one side, without symmetries, over points of the unit sphere.
Points egg(const Points& sphere) {
  Points result(sphere.rows(), 3);
  for (Eigen::Index v = 0; v < sphere.rows(); ++v) {
    const Eigen::RowVector3d p = sphere.row(v).normalized();
    result.row(v) = Eigen::RowVector3d(p[0] + 0.3 * p[2] * p[2], 1.4 * p[1] + 0.2 * p[0] * p[2],
                                       2.0 * p[2] + 0.25 * p[0] + 0.1 * p[1] * p[1]);
  }
  return result;
}

zoo::Mesh egg_mesh() {
  zoo::Mesh mesh = zoo::perturbed_sphere(2, 3);
  mesh.vertices = egg(mesh.vertices);
  return mesh;
}

RowMatrix<double> features(const zoo::Mesh& mesh, const DiffusionParameters<double>& parameters,
                           FeatureInput kind = FeatureInput::wave_kernel) {
  const test::FeatureSurface<double> surface(mesh, kFunctions);
  const int count = static_cast<int>(parameters.first.weight.rows());
  return diffusion_net_forward({.inputs = count, .outputs = 6, .width = 10, .blocks = 2},
                               parameters, surface.context, surface.inputs(kind, count));
}

double relative(const RowMatrix<double>& found, const RowMatrix<double>& expected) {
  // Against how much features vary over the surface: a constant says nothing.
  const RowMatrix<double> varying = expected.rowwise() - expected.colwise().mean();
  return (found - expected).norm() / varying.norm();
}

// Channel c of `field` after the diffusion for times[c].
RowMatrix<double> diffused(const test::FeatureSurface<double>& surface,
                           const RowMatrix<double>& field, const RowMatrix<double>& times) {
  const int width = static_cast<int>(field.cols());
  const DiffusionSizes sizes{.inputs = width, .outputs = 1, .width = width, .blocks = 1};
  auto parameters = DiffusionParameters<double>::random(sizes, 1);
  parameters.first.weight.setIdentity();
  parameters.blocks[0].times = times;
  DiffusionTrace<double> trace;
  diffusion_net_forward(sizes, parameters, surface.context, field, &trace);
  return trace.blocks[0].diffused;
}

TEST(Diffusion, OfAnEigenfunctionIsDecay) {
  const test::FeatureSurface<double> surface(egg_mesh(), kFunctions);
  const RowMatrix<double> times = (RowMatrix<double>(1, 3) << 0.0, 0.01, 0.2).finished();
  for (const Eigen::Index i : {0, 1, 7, 20}) {
    const Eigen::VectorXd phi = surface.basis.functions.col(i);
    const RowMatrix<double> found = diffused(surface, phi.replicate(1, 3), times);
    for (int c = 0; c < 3; ++c) {
      const double factor = std::exp(-surface.basis.values[i] * times(0, c));
      EXPECT_LT((found.col(c) - factor * phi).norm(), 1e-7 * phi.norm()) << "function " << i;
    }
  }
}

TEST(Diffusion, ForNoTimeIsTheSpectralProjection) {
  const test::FeatureSurface<double> surface(egg_mesh(), kFunctions);
  const RowMatrix<double> field = test::noise(surface.operators.mass.size(), 3, 1);
  const RowMatrix<double> expected = surface.basis.project(field, surface.context.values.size());
  const RowMatrix<double> found = diffused(surface, field, RowMatrix<double>::Zero(1, 3));
  EXPECT_LT((found - expected).norm(), 1e-12 * expected.norm());
}

TEST(Diffusion, ForLongIsTheMeanOverEachComponent) {
  const zoo::Mesh mesh =
      zoo::joined(egg_mesh(), zoo::moved(egg_mesh(), Eigen::RowVector3d(9.0, 0.0, 0.0), 0.7));
  const test::FeatureSurface<double> surface(mesh, kFunctions);
  const RowMatrix<double> field = test::noise(surface.operators.mass.size(), 2, 1);
  const RowMatrix<double> found = diffused(surface, field, RowMatrix<double>::Constant(1, 2, 50.0));
  for (int part = 0; part < 2; ++part) {
    Eigen::RowVector2d sum = Eigen::RowVector2d::Zero();
    double area = 0.0;
    for (Eigen::Index v = 0; v < field.rows(); ++v) {
      if (surface.operators.component[v] == part) {
        sum += surface.operators.mass[v] * field.row(v);
        area += surface.operators.mass[v];
      }
    }
    for (Eigen::Index v = 0; v < field.rows(); ++v) {
      if (surface.operators.component[v] == part) {
        EXPECT_LT((found.row(v) - sum / area).norm(), 1e-6);
      }
    }
  }
}

TEST(DiffusionNet, FollowsTheOrderOfTheVertices) {
  const zoo::Mesh mesh = egg_mesh();
  std::vector<int> to(static_cast<size_t>(mesh.vertices.rows()));
  std::iota(to.begin(), to.end(), 0);
  std::shuffle(to.begin(), to.end(), std::mt19937(4));
  zoo::Mesh permuted = mesh;
  for (size_t v = 0; v < to.size(); ++v) {
    permuted.vertices.row(to[v]) = mesh.vertices.row(static_cast<Eigen::Index>(v));
  }
  for (Eigen::Index f = 0; f < mesh.faces.rows(); ++f) {
    for (int c = 0; c < 3; ++c) {
      permuted.faces(f, c) = to[static_cast<size_t>(mesh.faces(f, (c + 1) % 3))];
    }
  }
  permuted.faces = permuted.faces.colwise().reverse().eval();
  const auto parameters = awake<double>();
  const RowMatrix<double> before = features(mesh, parameters),
                          after = features(permuted, parameters);
  RowMatrix<double> back(after.rows(), after.cols());
  for (size_t v = 0; v < to.size(); ++v) {
    back.row(static_cast<Eigen::Index>(v)) = after.row(to[v]);
  }
  EXPECT_LT(relative(back, before), 1e-6);
}

TEST(DiffusionNet, DoesNotSeeWhereTheSurfaceLies) {
  const zoo::Mesh mesh = egg_mesh();
  zoo::Mesh moved = mesh;
  moved.vertices = 2.5 * mesh.vertices * test::rotation(3);
  moved.vertices.rowwise() += Eigen::RowVector3d(4.0, -3.0, 1.0);
  const auto parameters = awake<double>();
  EXPECT_LT(relative(features(moved, parameters), features(mesh, parameters)), 1e-6);
  // Coordinates do.
  const auto three = test::awake_diffusion_net<double>(
      {.inputs = 3, .outputs = 6, .width = 10, .blocks = 2}, 5, kStrength);
  EXPECT_GT(relative(features(moved, three, FeatureInput::coordinates),
                     features(mesh, three, FeatureInput::coordinates)),
            0.1);
}

TEST(DiffusionNet, DoesNotDependOnTheTangentFrames) {
  const test::FeatureSurface<double> surface(egg_mesh(), kFunctions);
  Points axes = tangent_axes(surface.operators.vertex_normals);
  for (Eigen::Index v = 0; v < axes.rows(); ++v) {
    const Eigen::Vector3d normal = surface.operators.vertex_normals.row(v);
    const Eigen::RowVector3d axis = axes.row(v);
    axes.row(v) = Eigen::AngleAxisd(1.0 + static_cast<double>(v), normal) * axis.transpose();
  }
  const DiffusionContext<double> turned(surface.operators, surface.basis, kFunctions, axes);
  const auto parameters = awake<double>();
  const RowMatrix<double> input = surface.inputs(FeatureInput::wave_kernel, 8);
  ASSERT_GT((turned.gradient - surface.context.gradient).norm(), 1.0);
  EXPECT_LT(relative(diffusion_net_forward(kSizes, parameters, turned, input),
                     diffusion_net_forward(kSizes, parameters, surface.context, input)),
            1e-12);
}

TEST(DiffusionNet, TellsAMirroredSurfaceByTheImaginaryPart) {
  const zoo::Mesh mesh = egg_mesh();
  zoo::Mesh mirrored = mesh;
  mirrored.vertices.col(0) *= -1.0;
  mirrored.faces.col(1).swap(mirrored.faces.col(2));
  const auto parameters = awake<double>();
  auto conjugate = parameters, real = parameters;
  for (size_t b = 0; b < parameters.blocks.size(); ++b) {
    conjugate.blocks[b].imaginary *= -1.0;
    real.blocks[b].imaginary.setZero();
  }
  const RowMatrix<double> seen = features(mirrored, parameters);
  EXPECT_GT(relative(seen, features(mesh, parameters)), 1e-2);
  EXPECT_LT(relative(seen, features(mesh, conjugate)), 1e-6);
  EXPECT_LT(relative(features(mirrored, real), features(mesh, real)), 1e-6);
}

// rows of `field`, on a triangulation of the unit sphere, linearly between its corners at `points`.
RowMatrix<double> on_the_sphere(const Points& vertices, const Faces& faces,
                                const RowMatrix<double>& field, const Points& points) {
  const CornerTable corners(faces, vertices.rows());
  RowMatrix<double> result(points.rows(), field.cols());
  for (Eigen::Index v = 0; v < points.rows(); ++v) {
    Eigen::Index near = 0;
    (vertices * points.row(v).transpose()).maxCoeff(&near);
    double best = -1e300;
    for (int i = corners.first[near]; i < corners.first[near + 1]; ++i) {
      const auto face = faces.row(corners.corner[i] / 3);
      Matrix3 ends;
      ends << vertices.row(face[0]), vertices.row(face[1]), vertices.row(face[2]);
      Eigen::RowVector3d weights = points.row(v) * ends.inverse();
      weights /= weights.sum();
      if (weights.minCoeff() > best) {  // the face that the point is in, or nearest to
        best = weights.minCoeff();
        result.row(v) = weights[0] * field.row(face[0]) + weights[1] * field.row(face[1]) +
                        weights[2] * field.row(face[2]);
      }
    }
  }
  return result;
}

TEST(DiffusionNet, SlowTwoTriangulationsOfOneSurface) {
  // 10242 vertices and, elsewhere, 2562. The inputs are functions of the surface alone.
  zoo::Mesh regular = zoo::icosphere(5), irregular = zoo::perturbed_sphere(4, 7);
  const Points at = regular.vertices.rowwise().normalized(),
               other = irregular.vertices.rowwise().normalized();
  regular.vertices = egg(at);
  irregular.vertices = egg(other);
  const RowMatrix<double> waves = 3.0 * test::noise(3, kSizes.inputs, 1);
  const auto parameters = test::awake_diffusion_net<double>(kSizes, 5);
  const auto answer = [&](const zoo::Mesh& mesh, const Points& sphere) {
    const test::FeatureSurface<double> surface(mesh, kFunctions);
    const RowMatrix<double> input = (sphere * waves).array().sin();
    return diffusion_net_forward(kSizes, parameters, surface.context, input);
  };
  const RowMatrix<double> found = answer(irregular, other), expected = answer(regular, at);
  EXPECT_LT(relative(found, on_the_sphere(at, regular.faces, expected, other)), 0.03);
  EXPECT_GT(relative(found, on_the_sphere(at, regular.faces, expected, -other)), 0.5);
}

TEST(DiffusionNet, TheImaginaryDiagonalHasNoEffect) {
  const zoo::Mesh mesh = egg_mesh();
  const auto parameters = awake<double>();
  auto other = parameters;
  other.blocks[0].imaginary.diagonal().array() += 50.0;
  EXPECT_LT(relative(features(mesh, other), features(mesh, parameters)), 1e-10);
  other.blocks[0].imaginary(1, 2) += 50.0;
  EXPECT_GT(relative(features(mesh, other), features(mesh, parameters)), 1e-2);
}

TEST(DiffusionNet, SameThreadsSameBytes) {
  const test::Threads threads(2);
  const test::FeatureSurface<float> surface(egg_mesh(), kFunctions);
  const auto parameters = awake<float>();
  const RowMatrix<float> input = surface.inputs(FeatureInput::wave_kernel, 8);
  const auto run = [&](DiffusionParameters<float>& gradient) {
    DiffusionTrace<float> trace;
    RowMatrix<float> output =
        diffusion_net_forward(kSizes, parameters, surface.context, input, &trace);
    diffusion_net_backward(kSizes, parameters, surface.context, trace, output, gradient);
    return output;
  };
  auto first = DiffusionParameters<float>::zeros(kSizes), second = first;
  EXPECT_EQ(run(first), run(second));
  EXPECT_EQ(first.tensors(), second.tensors());
}

TEST(DiffusionNet, FloatIsCloseToDouble) {
  const zoo::Mesh mesh = egg_mesh();
  const test::FeatureSurface<float> single(mesh, kFunctions);
  const RowMatrix<double> exact = features(mesh, awake<double>());
  const RowMatrix<float> found = diffusion_net_forward(kSizes, awake<float>(), single.context,
                                                       single.inputs(FeatureInput::wave_kernel, 8));
  EXPECT_LT(relative(found.cast<double>(), exact), 1e-4);
}

TEST(DiffusionNet, InputsAndParametersOfOtherShapes) {
  const test::FeatureSurface<double> surface(egg_mesh(), kFunctions);
  const auto parameters = awake<double>();
  const RowMatrix<double> input = surface.inputs(FeatureInput::wave_kernel, 8);
  const auto fails = [&](const DiffusionSizes& sizes, const RowMatrix<double>& given,
                         std::initializer_list<const char*> parts) {
    return test::fails_with(ErrorCode::wrong_shape, parts, [&] {
      diffusion_net_forward(sizes, parameters, surface.context, given);
    });
  };
  EXPECT_TRUE(fails(kSizes, input.leftCols(7), {"x 8 inputs", "x 7"}));
  EXPECT_TRUE(fails(kSizes, input.topRows(5), {"not 5 x 8"}));
  EXPECT_TRUE(fails({.inputs = 8, .outputs = 6, .width = 11, .blocks = 2}, input, {"parameters"}));
  EXPECT_TRUE(fails({.inputs = 8, .outputs = 6, .width = 10, .blocks = 1}, input, {"parameters"}));
}

TEST(DiffusionContext, Refusals) {
  const test::FeatureSurface<double> surface(egg_mesh(), kFunctions);
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"in 0 eigenfunctions"}, [&] {
    DiffusionContext<double>(surface.operators, surface.basis, 0);
  }));
  const test::FeatureSurface<double> other(zoo::perturbed_sphere(1, 3), 5);
  EXPECT_TRUE(test::fails_with(ErrorCode::wrong_shape, {"42 vertices", "162"}, [&] {
    DiffusionContext<double>(surface.operators, other.basis, 5);
  }));
}

}  // namespace
}  // namespace supple
