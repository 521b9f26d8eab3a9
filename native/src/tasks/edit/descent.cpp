// SPDX-License-Identifier: GPL-3.0-or-later
#include "descent.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace supple {
namespace {

// Rows that are summed together: the same whatever the number of threads.
constexpr Eigen::Index kChunk = 1024;

double dot(const Points& a, const Points& b) {
  const Eigen::Index chunks = (a.rows() + kChunk - 1) / kChunk;
  Eigen::VectorXd parts(chunks);
#pragma omp parallel for schedule(static)
  for (Eigen::Index i = 0; i < chunks; ++i) {
    const Eigen::Index first = i * kChunk, rows = std::min(kChunk, a.rows() - first);
    parts[i] = a.middleRows(first, rows).cwiseProduct(b.middleRows(first, rows)).sum();
  }
  return parts.sum();
}

// a += scale b.
void add(Points& a, double scale, const Points& b) {
#pragma omp parallel for schedule(static)
  for (Eigen::Index first = 0; first < a.rows(); first += kChunk) {
    const Eigen::Index rows = std::min(kChunk, a.rows() - first);
    a.middleRows(first, rows) += scale * b.middleRows(first, rows);
  }
}

}  // namespace

void Descent::forget() {
  memory_.clear();
  started_ = converged_ = false;
}

void Descent::pass(Points& moved) {
  const auto hold = [&](Points& gradient) {
    for (const int vertex : poisson_.held()) {
      gradient.row(vertex).setZero();
    }
  };
  if (!started_) {
    value_ = energy_.evaluate(moved, gradient_);
    hold(gradient_);
    solved_ = poisson_.correction(gradient_);
    started_ = true;
  }
  // Two loops (Nocedal 1980); `direction` is kept as what the Laplacian's inverse makes of it, so
  // that a pass needs one solve.
  std::vector<double> along(memory_.size());
  Points remaining = gradient_, direction = solved_;
  for (size_t i = memory_.size(); i-- > 0;) {
    along[i] = dot(memory_[i].step, remaining) / memory_[i].product;
    add(remaining, -along[i], memory_[i].change);
    add(direction, -along[i], memory_[i].solved);
  }
  direction *= memory_.empty()
                   ? 1.0 / energy_.stiffness()
                   : memory_.back().product / dot(memory_.back().change, memory_.back().solved);
  for (size_t i = 0; i < memory_.size(); ++i) {
    const double other = dot(memory_[i].change, direction) / memory_[i].product;
    add(direction, along[i] - other, memory_[i].step);
  }

  const double slope = -dot(gradient_, direction);
  if (!(slope < 0.0)) {  // at a minimum, to rounding
    converged_ = true;
    return;
  }
  constexpr double kEnough = 1e-4, kShortest = 1e-3;
  Points next, next_gradient;
  double next_value = 0.0, length = 1.0;
  for (;; length *= 0.5) {
    next = moved - length * direction;
    next_value = energy_.evaluate(next, next_gradient);
    if (next_value <= value_ + kEnough * length * slope) {
      break;
    }
    if (length < kShortest) {
      converged_ = true;
      return;
    }
  }
  hold(next_gradient);
  Points next_solved = poisson_.correction(next_gradient);
  Pair pair{next - moved, next_gradient - gradient_, next_solved - solved_, 0.0};
  pair.product = dot(pair.step, pair.change);
  if (pair.product > 1e-12 * pair.step.norm() * pair.change.norm()) {
    memory_.push_back(std::move(pair));
    if (memory_.size() > kMemory) {
      memory_.pop_front();
    }
  }
  converged_ = value_ - next_value <= 1e-7 * std::abs(next_value);
  moved = std::move(next);
  gradient_ = std::move(next_gradient);
  solved_ = std::move(next_solved);
  value_ = next_value;
}

}  // namespace supple
