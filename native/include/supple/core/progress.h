// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <chrono>
#include <mutex>
#include <optional>
#include <string>

namespace supple {

/// Progress and cancellation of one long call, shared between the thread that works and the threads
/// that watch. All members may be called from any thread.
class Progress {
 public:
  /// Part of the call that is done, 0 to 1; never goes back within a call.
  double fraction() const { return fraction_.load(std::memory_order_relaxed); }
  /// What is being done, in words ("eigenbasis").
  std::string stage() const;
  /// Estimate from the time and fraction so far, in seconds; none before 2% is done.
  std::optional<double> seconds_left() const;
  /// Asks the call to stop; it throws `Error` with `ErrorCode::cancelled` at its next check.
  void cancel() { cancelled_.store(true, std::memory_order_relaxed); }
  bool cancelled() const { return cancelled_.load(std::memory_order_relaxed); }

 private:
  friend class ProgressRange;
  void set_stage(const std::string& stage);
  void set_fraction(double fraction);

  std::atomic<double> fraction_{0.0};
  std::atomic<bool> cancelled_{false};
  mutable std::mutex mutex_;
  std::string stage_;
  std::optional<std::chrono::steady_clock::time_point> start_;
};

/// A worker's share [from, to] of a Progress. Cheap to copy; the default one reports to nobody.
class ProgressRange {
 public:
  ProgressRange() = default;
  explicit ProgressRange(Progress* progress) : progress_(progress) {}

  /// The part [from, to] of this range, 0 <= from <= to <= 1, under its own name.
  ProgressRange stage(const std::string& name, double from, double to) const;
  /// Sets the done part of this range, 0 to 1. Throws `Error` (cancelled) if asked to stop.
  void report(double fraction) const;

 private:
  ProgressRange(Progress* progress, double from, double to)
      : progress_(progress), from_(from), to_(to) {}

  Progress* progress_ = nullptr;
  double from_ = 0.0;
  double to_ = 1.0;
};

}  // namespace supple
