// SPDX-License-Identifier: GPL-3.0-or-later
#include "block_krylov.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <utility>
#include <vector>

#include "supple/core/dense.h"
#include "supple/core/tall.h"

namespace supple {
namespace {

// Columns of a new block shorter than this, relative to before they were made orthogonal, are
// rounding: the space has ended in that direction.
constexpr double kLost = 1e-12;
// Parts of a block along those long before it that are still as good as none. Where more is found,
// nothing is skipped any more.
constexpr double kMostRounding = 1e-11;

class BlockKrylov {
 public:
  BlockKrylov(const Eigenproblem& problem, const RowMatrix<double>& locked,
              const BlockKrylovOptions& options, const ProgressRange& progress)
      : problem_(problem),
        locked_(locked),
        options_(options),
        progress_(progress),
        width_(block_width(options.count)),
        capacity_(std::min(available() / width_ * width_ - width_,
                           round_up(6 * options.count + 2 * width_))),
        random_(options.seed) {}

  Pairs run() {
    if (capacity_ < 2 * width_) {
      return {Eigen::VectorXd(0), RowMatrix<double>(problem_.size(), 0)};
    }
    projected_ = Eigen::MatrixXd::Zero(capacity_ + width_, capacity_ + width_);
    RowMatrix<double> start(problem_.size(), width_);
    fill_random(start);
    append(std::move(start), nullptr);
    for (int restart = 0;; ++restart) {
      extend();
      if (converged() || restart == options_.max_restarts ||
          capacity_ < options_.count + 3 * width_) {
        return result();
      }
      compress();
    }
  }

 private:
  Eigen::Index available() const {
    return problem_.size() - problem_.kernel_size() - locked_.cols();
  }
  Eigen::Index round_up(Eigen::Index n) const { return (n + width_ - 1) / width_ * width_; }
  // The basis's columns first..first+count, both multiples of the width.
  TallPieces<double> columns(Eigen::Index first, Eigen::Index count) const {
    const auto begin = basis_.begin() + first / width_;
    return {begin, begin + count / width_};
  }

  void fill_random(RowMatrix<double>& block) {
    for (Eigen::Index i = 0; i < block.size(); ++i) {
      // By hand: std::uniform_real_distribution differs between libraries.
      block.data()[i] = static_cast<double>(random_() >> 11) * 0x1.0p-52 - 1.0;
    }
  }

  struct Columns {
    Eigen::Index first, count;
  };
  // What the rounding of a block that is about to be appended is taken out along. All of the basis
  // has to be read for that, which on a large mesh takes as long as the solves. But what is left
  // grows along functions that have converged, some 500 times a block, and those lie in the
  // first columns; so all are looked at for two blocks in every four (Simon 1984: partial
  // reorthogonalisation, of two neighbours each time), and for others those and the last two.
  std::vector<Columns> rounding() const {
    constexpr Eigen::Index kPeriod = 4;
    const Eigen::Index head = std::max(round_up(options_.count / 2), kept_);
    if (!skips_ || head + 2 * width_ >= filled_ || filled_ / width_ % kPeriod < 2) {
      return whole();
    }
    return {{0, head}, last_two()};
  }
  std::vector<Columns> whole() const { return {{0, filled_}}; }
  Columns last_two() const { return {filled_ - 2 * width_, 2 * width_}; }

  // Takes the parts along the kernel, `locked` and some of the basis's columns out of a block; adds
  // those along the basis to `coefficients`, of the block before it was scaled. Returns the largest
  // of them but for the last two blocks'.
  double make_orthogonal(RowMatrix<double>& block, const std::vector<Columns>& against,
                         const RowMatrix<double>& scale, RowMatrix<double>* coefficients) {
    problem_.leave_kernel(block);
    if (locked_.cols() > 0) {
      add_tall_product<double>(-1.0, {locked_}, tall_product<double>({locked_}, block), block);
    }
    TallPieces<double> pieces;
    for (const Columns& range : against) {
      for (const auto& piece : columns(range.first, range.count)) {
        pieces.push_back(piece);
      }
    }
    if (pieces.empty()) {
      return 0.0;
    }
    const RowMatrix<double> part = tall_product<double>(pieces, block);
    add_tall_product<double>(-1.0, pieces, part, block);
    if (coefficients != nullptr) {
      const RowMatrix<double> scaled = part * scale;
      Eigen::Index done = 0;
      for (const Columns& range : against) {
        coefficients->middleRows(range.first, range.count) += scaled.middleRows(done, range.count);
        done += range.count;
      }
    }
    const Eigen::Index before = part.rows() - 2 * width_;
    return before > 0 ? part.topRows(before).cwiseAbs().maxCoeff() : 0.0;
  }

  // Makes a block orthonormal to all before and appends it. For a block A V_last, records its
  // coefficients: H(:, last) above and the block below the diagonal.
  void append(RowMatrix<double> block, RowMatrix<double>* coefficients) {
    RowMatrix<double> below = RowMatrix<double>::Identity(width_, width_);
    const double before = block.norm();
    bool all = false;       // whether the next pass looks at all of the basis, whatever is due
    bool complete = false;  // whether a look at all of the basis is known to find nothing
    for (int pass = 0; pass < 4; ++pass) {
      // A V_last has parts along its own block and the one before, or what a restart kept. Along
      // the others it has only rounding, which the next pass takes out.
      if (pass == 0 && filled_ > kept_ + 2 * width_) {
        make_orthogonal(block, {last_two()}, below, coefficients);
      } else {
        const std::vector<Columns> against = all ? whole() : rounding();
        const double found = make_orthogonal(block, against, below, coefficients);
        // Where there is too much, no later block is spared either.
        skips_ = skips_ && (pass == 0 || found < kMostRounding);
        complete = against.size() == 1 || found < kMostRounding;
        all = !complete;
      }
      // block = Q T by the eigenvectors of its Gram matrix (SVQB, Stathopoulos and Wu 2002).
      Eigen::MatrixXd gram = tall_product<double>({block}, block);
      const Eigen::VectorXd size = symmetric_eigen(gram);
      const double least = std::max(pass == 0 ? kLost * before : 0.5,
                                    1e-14 * std::sqrt(std::max(size[width_ - 1], 0.0)));
      RowMatrix<double> to_orthonormal = RowMatrix<double>::Zero(width_, width_),
                        back = to_orthonormal;
      Eigen::Index lost = 0;
      for (Eigen::Index i = 0; i < width_; ++i) {
        const double length = std::sqrt(std::max(size[i], 0.0));
        if (length <= least) {
          ++lost;
          continue;
        }
        to_orthonormal.col(i) = gram.col(i) / length;
        back.row(i) = length * gram.col(i).transpose();
      }
      RowMatrix<double> next = RowMatrix<double>::Zero(block.rows(), width_);
      add_tall_product<double>(1.0, {block}, to_orthonormal, next);
      below = back * below;
      if (lost > 0) {
        RowMatrix<double> fresh(block.rows(), lost);
        fill_random(fresh);
        next.leftCols(lost) = fresh / std::sqrt(static_cast<double>(block.rows()) / 3.0);
        below.topRows(lost).setZero();  // they come from nowhere
      }
      block = std::move(next);
      all = all || lost > 0;  // what replaces a lost column has parts along everything
      if (pass > 0 && complete && lost == 0 && size[0] > 0.9 && size[width_ - 1] < 1.1) {
        break;
      }
    }
    basis_.push_back(std::move(block));
    if (coefficients != nullptr) {
      const Eigen::Index last = filled_ - width_;
      projected_.block(0, last, filled_, width_) = *coefficients;
      projected_.block(filled_, last, width_, width_) = below;
    }
    filled_ += width_;
  }

  void extend() {
    // Eigenvalues of a surface grow as their number (Weyl), so every mesh needs about as many
    // dimensions for each function. Looking earlier costs more than it finds.
    const Eigen::Index first_check = round_up(13 * options_.count / 4);
    while (filled_ <= capacity_ && size_ < capacity_) {
      RowMatrix<double> block = problem_.inverse(basis_.back());
      RowMatrix<double> coefficients = RowMatrix<double>::Zero(filled_, width_);
      size_ = filled_;
      append(std::move(block), &coefficients);
      applied_ += width_;
      progress_.report(
          std::min(0.95, static_cast<double>(applied_) / static_cast<double>(capacity_ + width_)));
      if (size_ >= first_check && (size_ - first_check) / width_ % 2 == 0 && size_ < capacity_) {
        if (converged()) {
          return;
        }
      }
    }
  }

  // Ritz pairs of the projected inverse, largest first, and their residuals' estimates.
  bool converged() {
    Eigen::MatrixXd h = projected_.topLeftCorner(size_, size_);
    h = (0.5 * (h + h.transpose())).eval();
    const Eigen::VectorXd ascending = symmetric_eigen(h);
    ritz_values_ = ascending.reverse();
    ritz_vectors_ = h.rowwise().reverse();
    const Eigen::Index count = std::min(options_.count, size_);
    // (A - theta) V y = V_next B y_last; relative to theta it is the residual of one more inverse
    // iteration, which `result` makes, in the terms of S.
    const Eigen::MatrixXd leak =
        projected_.block(size_, size_ - width_, width_, width_) * ritz_vectors_.bottomRows(width_);
    estimate_ = leak.colwise().norm().transpose().cwiseQuotient(ritz_values_.cwiseAbs());
    converged_count_ = 0;
    while (converged_count_ < count && estimate_[converged_count_] <= options_.tolerance) {
      ++converged_count_;
    }
    return converged_count_ == count;
  }

  // Thick restart: the best Ritz vectors and the block after them.
  void compress() {
    const Eigen::Index keep =
        std::min(options_.count + 2 * width_, size_ - width_) / width_ * width_;
    const RowMatrix<double> head = ritz_vectors_.leftCols(keep);
    RowMatrix<double> kept = RowMatrix<double>::Zero(problem_.size(), keep);
    add_tall_product<double>(1.0, columns(0, size_), head, kept);
    basis_.erase(basis_.begin() + keep / width_, basis_.end() - 1);
    for (Eigen::Index first = 0; first < keep; first += width_) {
      basis_[static_cast<size_t>(first / width_)] = kept.middleCols(first, width_);
    }
    const Eigen::MatrixXd leak =
        projected_.block(size_, size_ - width_, width_, width_) * ritz_vectors_.bottomRows(width_);
    projected_.setZero();
    projected_.topLeftCorner(keep, keep) = ritz_values_.head(keep).asDiagonal();
    projected_.block(keep, 0, width_, keep) = leak.leftCols(keep);
    filled_ = keep + width_;
    kept_ = keep;
    size_ = 0;
  }

  Pairs result() {
    const Eigen::Index count = converged_count_;
    const Eigen::VectorXd inverse = ritz_values_.head(count).cwiseInverse();
    RowMatrix<double> combination(size_ + width_, count);
    combination.topRows(size_) = ritz_vectors_.leftCols(count);
    combination.bottomRows(width_) = projected_.block(size_, size_ - width_, width_, width_) *
                                     ritz_vectors_.bottomRows(width_).leftCols(count) *
                                     inverse.asDiagonal();
    Pairs pairs;
    pairs.values = inverse.array() - problem_.shift();
    pairs.vectors.setZero(problem_.size(), count);
    add_tall_product<double>(1.0, columns(0, size_ + width_), combination, pairs.vectors);
    return pairs;
  }

  const Eigenproblem& problem_;
  const RowMatrix<double>& locked_;
  const BlockKrylovOptions& options_;
  const ProgressRange& progress_;
  const Eigen::Index width_, capacity_;
  std::mt19937_64 random_;
  std::vector<RowMatrix<double>> basis_;  // n x width each
  Eigen::MatrixXd projected_;
  Eigen::Index filled_ = 0;  // columns of the basis that are set
  Eigen::Index size_ = 0;    // of them, those that A was applied to
  Eigen::Index kept_ = 0;    // by the last restart
  Eigen::Index applied_ = 0;
  bool skips_ = true;  // whether all of the basis is looked at for some blocks only
  Eigen::VectorXd ritz_values_, estimate_;
  Eigen::MatrixXd ritz_vectors_;
  Eigen::Index converged_count_ = 0;
};

}  // namespace

Eigen::Index block_width(Eigen::Index count) { return count >= 16 ? 8 : 4; }

Pairs block_krylov(const Eigenproblem& problem, const RowMatrix<double>& locked,
                   const BlockKrylovOptions& options, const ProgressRange& progress) {
  return BlockKrylov(problem, locked, options, progress).run();
}

}  // namespace supple
