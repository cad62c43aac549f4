// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <chrono>

namespace orbslam {

/// A span of time that begins now.
class TimeLimit {
 public:
  explicit TimeLimit(double seconds)
      : end_(std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds)) {}
  /// Seconds left; negative when it is over.
  double left() const {
    return std::chrono::duration<double>(end_ - std::chrono::steady_clock::now()).count();
  }

 private:
  std::chrono::time_point<std::chrono::steady_clock, std::chrono::duration<double>> end_;
};

/// Whether there is a flag and it is set.
inline bool is_raised(const std::atomic<bool>* flag) { return flag != nullptr && flag->load(); }

/// Decides when a minimisation ends: after `max_successful` successful steps, after three in a row
/// with a relative decrease below 1e-3 or one below `converged`, after ten rejected ones in a row.
/// See docs/method/adjustment.md#stopping.
class BundleStopRule {
 public:
  BundleStopRule(int max_successful, double converged)
      : max_successful_(max_successful), converged_(converged) {}

  void start(double cost) { cost_ = cost; }
  // Both return whether the minimisation is done.
  bool accept(double cost);
  bool reject();

  int successful() const { return successful_; }

 private:
  int max_successful_;
  double converged_;
  int successful_ = 0, rejected_ = 0, small_decreases_ = 0;
  double cost_ = 0;
};

}  // namespace orbslam
