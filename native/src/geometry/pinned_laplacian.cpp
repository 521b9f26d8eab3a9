// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/geometry/pinned_laplacian.h"

#include <algorithm>
#include <string>
#include <unordered_map>

#include "held_rows.h"
#include "supple/core/error.h"
#include "supple/core/parallel.h"
#include "supple/core/tall.h"

namespace supple {
namespace {

constexpr Eigen::Index kKernelWidth = 8;
// Kernels solved for together: the factor's widest panel, for each of a few threads.
constexpr Eigen::Index kTogether = 64;

// Unit vectors of some vertices, n x k; a pinned vertex's is 0.
RowMatrix<double> units(const PinnedLaplacian& base, const std::vector<int>& vertices, size_t first,
                        Eigen::Index count) {
  RowMatrix<double> result = RowMatrix<double>::Zero(base.mass().size(), count);
  for (Eigen::Index i = 0; i < count; ++i) {
    result(vertices[first + static_cast<size_t>(i)], i) = 1.0;
  }
  return base.without_pins(std::move(result));
}

// Place of each component's first held vertex, for every held one; and the places of the others.
void find_references(const PinnedLaplacian& base, const Eigen::VectorXi& held,
                     Eigen::VectorXi& reference, Eigen::VectorXi& free) {
  held_slots(base.mass().size(), held);  // its errors
  Eigen::VectorXi first = Eigen::VectorXi::Constant(base.component_count(), -1);
  reference.resize(held.size());
  std::vector<int> others;
  for (int i = 0; i < held.size(); ++i) {
    int& here = first[base.component()[held[i]]];
    if (here < 0) {
      here = i;
    } else {
      others.push_back(i);
    }
    reference[i] = here;
  }
  for (int c = 0; c < first.size(); ++c) {
    if (first[c] < 0) {
      throw Error(ErrorCode::no_handles, "Component " + std::to_string(c) +
                                             " of the mesh has no point. Give it at least one.");
    }
  }
  free = Eigen::Map<Eigen::VectorXi>(others.data(), static_cast<Eigen::Index>(others.size()));
}

// The Gram matrix of the differences to the references, factored. It is definite: the differences
// of distinct vertices' Green's functions are independent.
Eigen::LLT<Eigen::MatrixXd> complement_of(const RowMatrix<double>& gram,
                                          const Eigen::VectorXd& compliance,
                                          const Eigen::VectorXi& reference,
                                          const Eigen::VectorXi& free) {
  Eigen::MatrixXd differences(free.size(), free.size());
  for (Eigen::Index i = 0; i < free.size(); ++i) {
    const int a = free[i], ra = reference[a];
    for (Eigen::Index j = 0; j < free.size(); ++j) {
      const int b = free[j], rb = reference[b];
      differences(i, j) = gram(a, b) - gram(ra, b) - gram(a, rb) + gram(ra, rb);
      differences(i, j) += ra == rb ? compliance[ra] : 0.0;
    }
    differences(i, i) += compliance[free[i]];
  }
  const SingleThread small;
  Eigen::LLT<Eigen::MatrixXd> result(differences);
  if (free.size() > 0 && result.info() != Eigen::Success) {
    throw Error(ErrorCode::not_positive_definite,
                "The points are too many or too near each other to be told apart. Give fewer.");
  }
  return result;
}

// Forces at all points: those at the free ones as given, those at the references such that each
// component's sum to 0.
RowMatrix<double> balanced(const RowMatrix<double>& at_free, const Eigen::VectorXi& reference,
                           const Eigen::VectorXi& free) {
  RowMatrix<double> force = RowMatrix<double>::Zero(reference.size(), at_free.cols());
  for (Eigen::Index i = 0; i < free.size(); ++i) {
    force.row(free[i]) = at_free.row(i);
    force.row(reference[free[i]]) -= at_free.row(i);
  }
  return force;
}

}  // namespace

PinnedLaplacian::PinnedLaplacian(const SparseMatrix& laplacian, Eigen::VectorXd mass,
                                 Eigen::VectorXi component, int component_count,
                                 std::shared_ptr<const SymbolicCholesky> symbolic)
    : mass_(std::move(mass)),
      component_(std::move(component)),
      pins_(first_of_each(component_, component_count)),
      factor_(with_held_rows(laplacian, pins_), std::move(symbolic)) {}

RowMatrix<double> PinnedLaplacian::without_pins(RowMatrix<double> rows) const {
  for (const int pin : pins_) {
    rows.row(pin).setZero();
  }
  return rows;
}

BiharmonicInterpolation::BiharmonicInterpolation(std::shared_ptr<const PinnedLaplacian> base,
                                                 Eigen::VectorXi points,
                                                 const BiharmonicInterpolation* former,
                                                 Eigen::VectorXd compliance)
    : base_(std::move(base)), points_(std::move(points)), compliance_(std::move(compliance)) {
  if (compliance_.size() == 0) {
    compliance_ = Eigen::VectorXd::Zero(points_.size());
  }
  find_references(*base_, points_, reference_, free_);
  find_kernels(former != nullptr && former->base_ == base_ ? former : nullptr);
  complement_ = complement_of(gram_, compliance_, reference_, free_);
}

void BiharmonicInterpolation::find_kernels(const BiharmonicInterpolation* former) {
  const Eigen::Index n = base_->mass().size(), count = points_.size();
  std::unordered_map<int, Eigen::Index> known;
  if (former != nullptr) {
    for (Eigen::Index i = 0; i < former->points_.size(); ++i) {
      known[former->points_[i]] = i;
    }
  }
  std::vector<int> missing;
  std::vector<Eigen::Index> source(static_cast<size_t>(count));  // in former; or -1 - missing's
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto found = known.find(points_[i]);
    if (found != known.end()) {
      source[static_cast<size_t>(i)] = found->second;
    } else {
      source[static_cast<size_t>(i)] = -1 - static_cast<Eigen::Index>(missing.size());
      missing.push_back(points_[i]);
    }
  }
  // Green's functions of the missing ones, several at once: G = W^-1 with the pins, twice.
  const Eigen::VectorXd& mass = base_->mass();
  const Eigen::VectorXi& component = base_->component();
  Eigen::VectorXd total = Eigen::VectorXd::Zero(base_->component_count());
  for (Eigen::Index v = 0; v < n; ++v) {
    total[component[v]] += mass[v];
  }
  std::vector<RowMatrix<double>> fresh;
  for (size_t first = 0; first < missing.size(); first += kTogether) {
    const auto width = std::min(kTogether, static_cast<Eigen::Index>(missing.size() - first));
    RowMatrix<double> together = base_->factor().solve(units(*base_, missing, first, width));
    RowMatrix<double> mean = RowMatrix<double>::Zero(total.size(), width);
    for (Eigen::Index v = 0; v < n; ++v) {
      mean.row(component[v]) += mass[v] * together.row(v);
    }
    mean = total.cwiseInverse().asDiagonal() * mean;
    // Zero on the other components, where the solve left it so.
    for (Eigen::Index v = 0; v < n; ++v) {
      together.row(v) = mass[v] * (together.row(v) - mean.row(component[v]));
    }
    together = base_->factor().solve(base_->without_pins(std::move(together)));
    for (Eigen::Index offset = 0; offset < width; offset += kKernelWidth) {
      const Eigen::Index columns = std::min(kKernelWidth, width - offset);
      fresh.push_back(RowMatrix<double>::Zero(n, kKernelWidth));
      fresh.back().leftCols(columns) = together.middleCols(offset, columns);
    }
  }

  // Former blocks are kept where nothing before them was taken out.
  const auto kept_block = [&](Eigen::Index block) {
    const Eigen::Index first = block * kKernelWidth;
    if (former == nullptr || first + kKernelWidth > count ||
        first + kKernelWidth > former->points_.size()) {
      return false;
    }
    for (Eigen::Index i = first; i < first + kKernelWidth; ++i) {
      if (source[static_cast<size_t>(i)] != i) {
        return false;
      }
    }
    return true;
  };
  const Eigen::Index blocks = (count + kKernelWidth - 1) / kKernelWidth;
  kernels_.resize(static_cast<size_t>(blocks));
  for (Eigen::Index b = 0; b < blocks; ++b) {
    if (kept_block(b)) {
      kernels_[static_cast<size_t>(b)] = former->kernels_[static_cast<size_t>(b)];
      continue;
    }
    auto block = std::make_shared<RowMatrix<double>>(RowMatrix<double>::Zero(n, kKernelWidth));
    for (Eigen::Index i = b * kKernelWidth; i < std::min(count, (b + 1) * kKernelWidth); ++i) {
      const Eigen::Index from = source[static_cast<size_t>(i)];
      const Eigen::Index place = from < 0 ? -1 - from : from;
      const RowMatrix<double>& whole =
          from < 0 ? fresh[static_cast<size_t>(place / kKernelWidth)]
                   : *former->kernels_[static_cast<size_t>(place / kKernelWidth)];
      block->col(i % kKernelWidth) = whole.col(place % kKernelWidth);
    }
    kernels_[static_cast<size_t>(b)] = std::move(block);
  }

  gram_.resize(count, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    for (Eigen::Index j = 0; j < count; ++j) {
      gram_(i, j) =
          (*kernels_[static_cast<size_t>(j / kKernelWidth)])(points_[i], j % kKernelWidth);
    }
  }
}

RowMatrix<double> BiharmonicInterpolation::solve(const RowMatrix<double>& values) const {
  const Eigen::Index n = base_->mass().size(), c = values.cols();
  if (values.rows() != points_.size()) {
    throw Error(ErrorCode::wrong_shape, "There are " + std::to_string(points_.size()) +
                                            " points but " + std::to_string(values.rows()) +
                                            " values.");
  }
  RowMatrix<double> wanted(free_.size(), c);
  for (Eigen::Index i = 0; i < free_.size(); ++i) {
    wanted.row(i) = values.row(free_[i]) - values.row(reference_[free_[i]]);
  }
  if (free_.size() > 0) {
    wanted = complement_.solve(wanted).eval();
  }
  RowMatrix<double> force =
      RowMatrix<double>::Zero(static_cast<Eigen::Index>(kernels_.size()) * kKernelWidth, c);
  force.topRows(points_.size()) = balanced(wanted, reference_, free_);
  TallPieces<double> pieces;
  for (const auto& kernel : kernels_) {
    pieces.emplace_back(*kernel);
  }
  RowMatrix<double> result = RowMatrix<double>::Zero(n, c);
  add_tall_product<double>(1.0, pieces, force, result);
  RowMatrix<double> offset(base_->component_count(), c);
  for (Eigen::Index i = 0; i < points_.size(); ++i) {
    if (reference_[i] == i) {
      offset.row(base_->component()[points_[i]]) =
          values.row(i) - result.row(points_[i]) - compliance_[i] * force.row(i);
    }
  }
#pragma omp parallel for schedule(static)
  for (Eigen::Index v = 0; v < n; ++v) {
    result.row(v) += offset.row(base_->component()[v]);
  }
  return result;
}

}  // namespace supple
