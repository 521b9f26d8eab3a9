// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/core/progress.h"

#include <algorithm>

#include "supple/core/error.h"

namespace supple {

std::string Progress::stage() const {
  const std::lock_guard lock(mutex_);
  return stage_;
}

std::optional<double> Progress::seconds_left() const {
  const double done = fraction();
  const std::lock_guard lock(mutex_);
  if (!start_ || done < 0.02) {
    return std::nullopt;
  }
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - *start_;
  return elapsed.count() * (1.0 - done) / done;
}

void Progress::set_stage(const std::string& stage) {
  const std::lock_guard lock(mutex_);
  stage_ = stage;
  if (!start_) {
    start_ = std::chrono::steady_clock::now();
  }
}

void Progress::set_fraction(double fraction) {
  fraction_.store(std::max(fraction_.load(std::memory_order_relaxed), fraction),
                  std::memory_order_relaxed);
}

ProgressRange ProgressRange::stage(const std::string& name, double from, double to) const {
  const double width = to_ - from_;
  const ProgressRange part(progress_, from_ + width * from, from_ + width * to);
  if (progress_ != nullptr) {
    progress_->set_stage(name);
    part.report(0.0);
  }
  return part;
}

void ProgressRange::report(double fraction) const {
  if (progress_ == nullptr) {
    return;
  }
  progress_->set_fraction(from_ + (to_ - from_) * std::clamp(fraction, 0.0, 1.0));
  if (progress_->cancelled()) {
    throw Error(ErrorCode::cancelled, "Cancelled.");
  }
}

}  // namespace supple
