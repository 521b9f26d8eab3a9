// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/core/dense.h"

#include <cblas.h>

#include <optional>
#include <string>
#include <vector>

#include "supple/core/error.h"
#include "supple/core/parallel.h"

extern "C" void dsyevd_(const char* jobz, const char* uplo, const int* n, double* a, const int* lda,
                        double* w, double* work, const int* lwork, int* iwork, const int* liwork,
                        int* info);

namespace supple {
namespace {

CBLAS_TRANSPOSE blas(Op op) { return op == Op::none ? CblasNoTrans : CblasTrans; }

void call(CBLAS_TRANSPOSE ta, CBLAS_TRANSPOSE tb, int m, int n, int k, float alpha, const float* a,
          int lda, const float* b, int ldb, float beta, float* c, int ldc) {
  cblas_sgemm(CblasRowMajor, ta, tb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc);
}

void call(CBLAS_TRANSPOSE ta, CBLAS_TRANSPOSE tb, int m, int n, int k, double alpha,
          const double* a, int lda, const double* b, int ldb, double beta, double* c, int ldc) {
  cblas_dgemm(CblasRowMajor, ta, tb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc);
}

}  // namespace

template <class Scalar>
void gemm(Scalar alpha, const RowMatrix<Scalar>& a, Op op_a, const RowMatrix<Scalar>& b, Op op_b,
          Scalar beta, RowMatrix<Scalar>& c) {
  const auto m = op_a == Op::none ? a.rows() : a.cols();
  const auto k = op_a == Op::none ? a.cols() : a.rows();
  const auto k_b = op_b == Op::none ? b.rows() : b.cols();
  const auto n = op_b == Op::none ? b.cols() : b.rows();
  if (k != k_b || (beta != Scalar(0) && (c.rows() != m || c.cols() != n))) {
    throw Error(ErrorCode::wrong_shape, "gemm: " + std::to_string(m) + "x" + std::to_string(k) +
                                            " times " + std::to_string(k_b) + "x" +
                                            std::to_string(n) + " does not fit.");
  }
  if (beta == Scalar(0)) {
    c.resize(m, n);
  }
  if (m == 0 || n == 0) {
    return;
  }
  if (k == 0) {
    if (beta == Scalar(0)) {
      c.setZero();
    } else {
      c *= beta;
    }
    return;
  }
  call(blas(op_a), blas(op_b), static_cast<int>(m), static_cast<int>(n), static_cast<int>(k), alpha,
       a.data(), static_cast<int>(a.cols()), b.data(), static_cast<int>(b.cols()), beta, c.data(),
       static_cast<int>(n));
}

std::string blas_name() { return openblas_get_config(); }

Eigen::VectorXd symmetric_eigen(Eigen::MatrixXd& matrix) {
  const int n = static_cast<int>(matrix.rows());
  Eigen::VectorXd values(n);
  if (n == 0) {
    return values;
  }
  const auto fail = [&] {
    throw Error(ErrorCode::no_convergence,
                "The eigenvalues of a " + std::to_string(n) + " x " + std::to_string(n) +
                    " matrix did not converge. Its numbers are not finite or far too large.");
  };
  if (!matrix.allFinite()) {
    fail();  // LAPACK may return NaN and report success
  }
  int info = 0, wanted_integers = 0;
  const int ask = -1;
  double wanted = 0.0;
  dsyevd_("V", "L", &n, matrix.data(), &n, values.data(), &wanted, &ask, &wanted_integers, &ask,
          &info);
  // LAPACK goes through thousands of small BLAS calls.
  std::optional<SingleThread> alone;
  if (n < 1500) {
    alone.emplace();
  }
  std::vector<double> work(static_cast<size_t>(wanted));
  std::vector<int> integers(static_cast<size_t>(wanted_integers));
  const int work_size = static_cast<int>(work.size()),
            integer_size = static_cast<int>(integers.size());
  dsyevd_("V", "L", &n, matrix.data(), &n, values.data(), work.data(), &work_size, integers.data(),
          &integer_size, &info);
  if (info != 0) {
    fail();
  }
  return values;
}

template void gemm<float>(float, const RowMatrix<float>&, Op, const RowMatrix<float>&, Op, float,
                          RowMatrix<float>&);
template void gemm<double>(double, const RowMatrix<double>&, Op, const RowMatrix<double>&, Op,
                           double, RowMatrix<double>&);

}  // namespace supple
