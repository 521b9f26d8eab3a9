// SPDX-License-Identifier: GPL-3.0-or-later
#include "lanczos.h"

#include <Spectra/SymEigsSolver.h>

#include <algorithm>

namespace supple {
namespace {

// (S + shift)^-1 without the kernel and what is locked: the operator whose largest eigenvalues are
// the wanted ones. Its input from Spectra is one vector.
class ShiftInvert {
 public:
  using Scalar = double;
  ShiftInvert(const Eigenproblem& problem, const RowMatrix<double>& locked,
              const ProgressRange& progress, int expected)
      : problem_(problem), locked_(locked), progress_(progress), expected_(expected) {}

  Eigen::Index rows() const { return problem_.size(); }
  Eigen::Index cols() const { return problem_.size(); }
  void perform_op(const double* in, double* out) const {
    progress_.report(std::min(0.95, double(++applied_) / expected_));
    RowMatrix<double> x = Eigen::Map<const RowMatrix<double>>(in, rows(), 1);
    deflate(x);
    RowMatrix<double> y = problem_.inverse(x);
    deflate(y);
    std::copy(y.data(), y.data() + y.size(), out);
  }

 private:
  void deflate(RowMatrix<double>& x) const {
    problem_.leave_kernel(x);
    if (locked_.cols() > 0) {
      x -= locked_ * (locked_.transpose() * x);
    }
  }
  const Eigenproblem& problem_;
  const RowMatrix<double>& locked_;
  const ProgressRange& progress_;
  int expected_;
  mutable int applied_ = 0;
};

}  // namespace

Pairs lanczos(const Eigenproblem& problem, const RowMatrix<double>& locked, Eigen::Index count,
              int max_restarts, const ProgressRange& progress) {
  const Eigen::Index space = problem.size() - locked.cols() - problem.kernel_size();
  const Eigen::Index krylov = std::min(space, std::max<Eigen::Index>(2 * count, 20));
  ShiftInvert op(problem, locked, progress, static_cast<int>(2 * krylov));
  Spectra::SymEigsSolver<ShiftInvert> solver(op, count, krylov);
  solver.init();  // a fixed pseudo-random start: the same bytes every time
  solver.compute(Spectra::SortRule::LargestAlge, max_restarts, 1e-13,
                 Spectra::SortRule::LargestAlge);
  // Not asking for Success: 1e-13 is a wish; what counts is the residual checked by the caller.
  Pairs pairs;
  pairs.vectors = solver.eigenvectors(count);  // the converged ones only
  pairs.values = solver.eigenvalues().cwiseInverse().array() - problem.shift();
  return pairs;
}

}  // namespace supple
