// SPDX-License-Identifier: GPL-3.0-or-later
// The CHOLMOD backend: its ordering, analysis and supernodal factor (Chen, Davis, Hager and
// Rajamanickam 2008); the triangular solves are our own, see supernodal_solve.h.
#ifdef SUPPLE_WITH_CHOLMOD

#include <cholmod.h>
#include <omp.h>

#include <algorithm>
#include <mutex>
#include <new>
#include <optional>
#include <vector>

#include "factor.h"
#include "supernodal_solve.h"
#include "supple/core/error.h"
#include "supple/core/parallel.h"

namespace supple {
namespace {

// Below this many operations, CHOLMOD's BLAS calls are so small that a second thread only costs.
constexpr double kThreadedWork = 2e10;

// One use of CHOLMOD: its workspace and messages.
class Session {
 public:
  Session() {
    cholmod_start(&common);
    common.print = 0;  // failures become errors, not text
    common.supernodal = CHOLMOD_SUPERNODAL;
    common.final_ll = 1;
    common.quick_return_if_not_posdef = 1;
  }
  ~Session() { cholmod_finish(&common); }
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;
  cholmod_common common;
};

// Eigen's matrix as CHOLMOD's, sharing the arrays, of which it reads the lower triangle.
cholmod_sparse view(const SparseMatrix& matrix) {
  cholmod_sparse result{};
  result.nrow = static_cast<size_t>(matrix.rows());
  result.ncol = static_cast<size_t>(matrix.cols());
  result.nzmax = static_cast<size_t>(matrix.nonZeros());
  result.p = const_cast<int*>(matrix.outerIndexPtr());
  result.i = const_cast<int*>(matrix.innerIndexPtr());
  result.nz = const_cast<int*>(matrix.innerNonZeroPtr());
  result.x = const_cast<double*>(matrix.valuePtr());
  result.stype = -1;
  result.itype = CHOLMOD_INT;
  result.xtype = CHOLMOD_REAL;
  result.dtype = CHOLMOD_DOUBLE;
  result.sorted = 1;
  result.packed = matrix.isCompressed() ? 1 : 0;
  return result;
}

struct FreeFactor {
  void operator()(cholmod_factor* factor) const {
    Session session;
    cholmod_free_factor(&factor, &session.common);
  }
};
using FactorPointer = std::unique_ptr<cholmod_factor, FreeFactor>;

void check_memory(const Session& session) {
  if (session.common.status == CHOLMOD_OUT_OF_MEMORY ||
      session.common.status == CHOLMOD_TOO_LARGE) {
    throw std::bad_alloc();
  }
}

struct FreeAligned {
  void operator()(void* p) const { ::operator delete[](p, std::align_val_t(64)); }
};
template <class Scalar>
using AlignedArray = std::unique_ptr<Scalar[], FreeAligned>;
template <class Scalar>
AlignedArray<Scalar> aligned_array(size_t count) {
  return AlignedArray<Scalar>(
      static_cast<Scalar*>(::operator new[](count * sizeof(Scalar), std::align_val_t(64))));
}

// The widest panel that still gives each thread one, and no wider than needed.
int panel_width(Eigen::Index columns, int threads) {
  const Eigen::Index share = (columns + threads - 1) / threads;
  return share <= 4 ? 4 : share <= 8 ? 8 : 16;
}

class CholmodFactor : public Factor {
 public:
  explicit CholmodFactor(FactorPointer factor) : factor_(std::move(factor)) {
    view_.supernodes = static_cast<int>(factor_->nsuper);
    view_.super = static_cast<const int*>(factor_->super);
    view_.row_start = static_cast<const int*>(factor_->pi);
    view_.value_start = static_cast<const int*>(factor_->px);
    view_.rows = static_cast<const int*>(factor_->s);
    view_.values = static_cast<const double*>(factor_->x);
    parts_ = supernode_parts(view_, static_cast<int>(factor_->n));
  }
  Eigen::Index entries() const override { return static_cast<Eigen::Index>(factor_->xsize); }

  RowMatrix<double> solve(const RowMatrix<double>& rhs, Substitution part,
                          Precision precision) const override {
    return precision == Precision::single ? solve_as<float>(rhs, part, with_single_values())
                                          : solve_as<double>(rhs, part, view_);
  }

 private:
  template <class Scalar>
  RowMatrix<double> solve_as(const RowMatrix<double>& rhs, Substitution part,
                             const SupernodalFactor& view) const {
    const Eigen::Index columns = rhs.cols();
    const int threads = omp_in_parallel() ? 1 : omp_get_max_threads();
    // Few columns share the tree, many are shared out.
    return columns <= kPanelWidths[1] && !parts_.top_rows.empty()
               ? solve_by_parts<Scalar>(rhs, part, view, panel_width(columns, 1))
               : solve_by_columns<Scalar>(rhs, part, view, panel_width(columns, threads));
  }

  SupernodalFactor with_single_values() const {
    std::call_once(rounded_, [&] {
      const auto entries = static_cast<Eigen::Index>(factor_->xsize);
      single_values_ = aligned_array<float>(factor_->xsize);
      Eigen::Map<Eigen::VectorXf>(single_values_.get(), entries) =
          Eigen::Map<const Eigen::VectorXd>(view_.values, entries).cast<float>();
    });
    SupernodalFactor view = view_;
    view.single_values = single_values_.get();
    return view;
  }

  // Where row i of a right-hand side or solution is.
  Eigen::Index place(Eigen::Index i, bool ordered) const {
    return ordered ? i : static_cast<const int*>(factor_->Perm)[i];
  }

  template <class Scalar>
  RowMatrix<double> solve_by_columns(const RowMatrix<double>& rhs, Substitution part,
                                     const SupernodalFactor& view, int width) const {
    const Eigen::Index n = rhs.rows(), columns = rhs.cols();
    const bool ordered_in = part == Substitution::backward;
    const bool ordered_out = part == Substitution::forward;
    const int panels = static_cast<int>((columns + width - 1) / width);
    const SupernodeRange all{0, view.supernodes};
    RowMatrix<double> solution(n, columns);
    std::vector<AlignedArray<Scalar>> buffers;  // allocated here: nothing may be thrown in the loop
    for (int p = 0; p < std::min(panels, omp_get_max_threads()); ++p) {
      buffers.push_back(aligned_array<Scalar>(static_cast<size_t>(n) * static_cast<size_t>(width)));
    }
#pragma omp parallel for schedule(static) \
    num_threads(static_cast <int>(buffers.size())) if (panels > 1)
    for (int p = 0; p < panels; ++p) {
      Scalar* const panel = buffers[static_cast<size_t>(omp_get_thread_num())].get();
      const Eigen::Index first = static_cast<Eigen::Index>(p) * width;
      const Eigen::Index count = std::min<Eigen::Index>(width, columns - first);
      for (Eigen::Index i = 0; i < n; ++i) {
        Scalar* const to = panel + i * width;
        const double* const from = rhs.data() + place(i, ordered_in) * columns + first;
        std::transform(from, from + count, to, [](double x) { return static_cast<Scalar>(x); });
        std::fill(to + count, to + width, Scalar(0));
      }
      if (part != Substitution::backward) {
        forward_panel(view, all, panel, width);
      }
      if (part != Substitution::forward) {
        backward_panel(view, all, panel, width);
      }
      for (Eigen::Index i = 0; i < n; ++i) {
        const Scalar* const from = panel + i * width;
        std::copy(from, from + count, solution.data() + place(i, ordered_out) * columns + first);
      }
    }
    return solution;
  }

  // One panel; each part of the tree in a copy of its own, which other parts do not read. What the
  // parts add to the top is summed in their order.
  template <class Scalar>
  RowMatrix<double> solve_by_parts(const RowMatrix<double>& rhs, Substitution part,
                                   const SupernodalFactor& view, int width) const {
    constexpr int kParts = SupernodeParts::kParts;
    const Eigen::Index n = rhs.rows(), columns = rhs.cols();
    const bool ordered_in = part == Substitution::backward;
    const bool ordered_out = part == Substitution::forward;
    const auto row = static_cast<size_t>(width);
    RowMatrix<double> solution(n, columns);
    std::vector<AlignedArray<Scalar>> panels;
    for (int p = 0; p <= kParts; ++p) {
      panels.push_back(aligned_array<Scalar>(static_cast<size_t>(n) * row));
    }
    Scalar* const top = panels.back().get();
    const auto row_in = [&](Eigen::Index i, Scalar* panel) {
      const double* const from = rhs.data() + place(i, ordered_in) * columns;
      std::transform(from, from + columns, panel + i * width,
                     [](double x) { return static_cast<Scalar>(x); });
      std::fill(panel + i * width + columns, panel + (i + 1) * width, Scalar(0));
    };
    const auto row_out = [&](Eigen::Index i, const Scalar* panel) {
      const Scalar* const from = panel + i * width;
      std::copy(from, from + columns, solution.data() + place(i, ordered_out) * columns);
    };
    const auto for_rows = [&](int p, const auto& visit) {
      for (const SupernodeRange& range : parts_.parts[p]) {
        for (Eigen::Index i = view.super[range.first]; i < view.super[range.last]; ++i) {
          visit(i);
        }
      }
    };
#pragma omp parallel for schedule(static)
    for (int p = 0; p < kParts; ++p) {
      Scalar* const panel = panels[static_cast<size_t>(p)].get();
      for (const int i : parts_.top_rows) {
        std::fill(panel + static_cast<size_t>(i) * row, panel + static_cast<size_t>(i + 1) * row,
                  Scalar(0));
      }
      for_rows(p, [&](Eigen::Index i) { row_in(i, panel); });
      if (part != Substitution::backward) {
        for (const SupernodeRange& range : parts_.parts[p]) {
          forward_panel(view, range, panel, width);
        }
      }
    }
    for (const int i : parts_.top_rows) {
      row_in(i, top);
      for (int p = 0; p < kParts; ++p) {
        for (int c = 0; c < width; ++c) {
          const size_t at = static_cast<size_t>(i) * row + static_cast<size_t>(c);
          top[at] += panels[static_cast<size_t>(p)][at];
        }
      }
    }
    if (part != Substitution::backward) {
      for (const SupernodeRange& range : parts_.top) {
        forward_panel(view, range, top, width);
      }
    }
    if (part != Substitution::forward) {
      for (auto range = parts_.top.rbegin(); range != parts_.top.rend(); ++range) {
        backward_panel(view, *range, top, width);
      }
    }
    for (const int i : parts_.top_rows) {
      row_out(i, top);
    }
#pragma omp parallel for schedule(static)
    for (int p = 0; p < kParts; ++p) {
      Scalar* const panel = panels[static_cast<size_t>(p)].get();
      if (part != Substitution::forward) {
        for (const int i : parts_.top_rows) {
          std::copy(top + static_cast<size_t>(i) * row, top + static_cast<size_t>(i + 1) * row,
                    panel + static_cast<size_t>(i) * row);
        }
        for (auto range = parts_.parts[p].rbegin(); range != parts_.parts[p].rend(); ++range) {
          backward_panel(view, *range, panel, width);
        }
      }
      for_rows(p, [&](Eigen::Index i) { row_out(i, panel); });
    }
    return solution;
  }

  FactorPointer factor_;
  SupernodalFactor view_;
  SupernodeParts parts_;
  mutable std::once_flag rounded_;
  mutable AlignedArray<float> single_values_;
};

}  // namespace

struct CholmodSymbolic::Impl {
  FactorPointer analysis;
  double work = 0.0;  // floating-point operations of a factorisation
};

CholmodSymbolic::CholmodSymbolic(const SparseMatrix& pattern, const Eigen::VectorXi& ordering,
                                 CholeskyOrdering method)
    : impl_(std::make_unique<Impl>()) {
  Session session;
  cholmod_sparse matrix = view(pattern);
  if (ordering.size() > 0) {
    session.common.nmethods = 1;
    session.common.method[0].ordering = CHOLMOD_GIVEN;
    Eigen::VectorXi given = ordering;  // CHOLMOD takes it writable
    impl_->analysis.reset(cholmod_analyze_p(&matrix, given.data(), nullptr, 0, &session.common));
  } else {
    if (method != CholeskyOrdering::automatic) {
      session.common.nmethods = 1;
      session.common.method[0].ordering =
          method == CholeskyOrdering::amd ? CHOLMOD_AMD : CHOLMOD_METIS;
    }
    impl_->analysis.reset(cholmod_analyze(&matrix, &session.common));
  }
  check_memory(session);
  if (session.common.status == CHOLMOD_NOT_INSTALLED) {
    throw Error(ErrorCode::bad_option, "This CHOLMOD was built without METIS. Use 'amd'.");
  }
  if (impl_->analysis == nullptr) {
    throw_not_definite(pattern.rows());
  }
  impl_->work = session.common.fl;
}

CholmodSymbolic::~CholmodSymbolic() = default;

Eigen::VectorXi CholmodSymbolic::ordering() const {
  return Eigen::Map<const Eigen::VectorXi>(static_cast<const int*>(impl_->analysis->Perm),
                                           static_cast<Eigen::Index>(impl_->analysis->n));
}

std::unique_ptr<const Factor> CholmodSymbolic::factor(const SparseMatrix& matrix) const {
  Session session;
  FactorPointer factor(cholmod_copy_factor(impl_->analysis.get(), &session.common));
  check_memory(session);
  cholmod_sparse values = view(matrix);
  std::optional<SingleThread> alone;
  if (impl_->work < kThreadedWork) {
    alone.emplace();
  }
  cholmod_factorize(&values, factor.get(), &session.common);
  alone.reset();
  check_memory(session);
  if (session.common.status != CHOLMOD_OK || factor->minor != factor->n) {
    throw_not_definite(matrix.rows());
  }
  return std::make_unique<const CholmodFactor>(std::move(factor));
}

}  // namespace supple

#endif  // SUPPLE_WITH_CHOLMOD
