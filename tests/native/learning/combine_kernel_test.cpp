// SPDX-License-Identifier: GPL-3.0-or-later
// What vertices contribute, a vector of them at a time, against its definition vertex by vertex.
#include "learning/combine_kernel.h"

#include "native/learning/networks.h"

namespace supple::equivariant {
namespace {

struct Case {
  zoo::Mesh mesh;
  int functions, fields;
};

template <class Scalar>
class Combined {
 public:
  explicit Combined(const Case& c)
      : rest(c.mesh, c.functions, 0),
        signal{},
        layout{c.fields},
        outputs((0.3 * test::noise(k(), output_count(c.fields), 2)).template cast<Scalar>()) {
    fields.signal = &signal;
    fields.look = &rest.context.rest;
    fields.reference = 0.9 * test::rotation(3);
    fields.coefficients = RowMatrix<Scalar>::Zero(k(), kPadded * c.fields);
    for (int i = 0; i < c.fields; ++i) {
      fields.coefficients.middleCols(kPadded * i, 9) =
          (0.1 * test::noise(k(), 9, 5 + static_cast<uint64_t>(i))).template cast<Scalar>();
    }
  }

  Eigen::Index k() const { return rest.context.functions.cols(); }

  // The definition in equivariant_parts.h, in double precision.
  Combination<double> expected(Eigen::Index v) const {
    const Eigen::RowVectorXd phi = rest.context.functions.row(v).template cast<double>();
    const Eigen::RowVectorXd c = phi * outputs.template cast<double>();
    Combination<double> result = {};
    Eigen::Map<Matrix3> along(result.along), normal(result.normal);
    Matrix3 defect = Matrix3::Zero();
    for (int i = 0; i < layout.fields; ++i) {
      for (int s = 0; s < kScaleCount; ++s) {
        const Eigen::Index count = rest.context.scales[static_cast<size_t>(s)];
        const RowMatrix<double> flat =
            phi.head(count) *
            fields.coefficients.block(0, kPadded * i, count, 9).template cast<double>();
        const Matrix3 away = Eigen::Map<const Matrix3>(flat.data());
        along += c[layout.smooth(i, s)] * away;
        normal += c[layout.smooth(i, s) + 1] * away;
        result.along[kSum] += c[layout.smooth(i, s)];
        result.along[kNormalSum] += c[layout.smooth(i, s) + 1];
        if (i == layout.fields - 1) {
          const Matrix3 y = fields.reference + away;
          defect += c[layout.defect(s)] * (y * y.transpose() - Matrix3::Identity());
        }
      }
    }
    for (int e = 0; e < 9; ++e) {
      result.normal[kDefect + kSymmetric[e]] = defect.data()[e];
    }
    if (layout.fields > 1) {
      result.along[kFirst] = c[layout.plain(0)];
      result.along[kNormalFirst] = c[layout.plain(0) + 1];
    }
    return result;
  }

  void check(double tolerance) const {
    const auto got = combine_at_vertices(rest.context, fields, outputs);
    for (Eigen::Index v = 0; v < rest.context.functions.rows(); ++v) {
      const Combination<Scalar>& here = got[static_cast<size_t>(v)];
      const Combination<double> wanted = expected(v);
      for (Eigen::Index e = 0; e < kPadded; ++e) {
        ASSERT_NEAR(here.along[e], wanted.along[e], tolerance) << "vertex " << v << ", " << e;
        ASSERT_NEAR(here.normal[e], wanted.normal[e], tolerance) << "vertex " << v << ", " << e;
      }
    }
  }

 private:
  test::RestMesh<Scalar> rest;
  Signal signal;
  Layout layout;
  RowMatrix<Scalar> outputs;
  Fields<Scalar> fields;
};

// Fewer and more functions than are taken together, and numbers of them and of vertices that fill
// no vector; 150 pieces have as many functions of eigenvalue 0, which are never cut through.
std::vector<Case> cases(int fields) {
  return {{zoo::perturbed_sphere(1, 3), 13, fields},
          {zoo::perturbed_sphere(3, 3), 128, fields},
          {zoo::perturbed_sphere(3, 3), 203, fields},
          {zoo::many_pieces(150), 128, fields}};
}

class CombineKernelFields : public ::testing::TestWithParam<int> {};

TEST_P(CombineKernelFields, IsWhatItIsDefinedAs) {
  for (const Case& c : cases(GetParam())) {
    const Combined<float> single(c);
    const Combined<double> exact(c);
    test::at_every_simd_level([&] {
      single.check(2e-2);
      exact.check(1e-10);
    });
  }
}

INSTANTIATE_TEST_SUITE_P(Fields, CombineKernelFields, ::testing::Values(1, 2));

}  // namespace
}  // namespace supple::equivariant
