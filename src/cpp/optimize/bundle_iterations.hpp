// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ceres/iteration_callback.h>

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

/// Ends a minimisation of Ceres: after `max_successful` successful steps, after three in a row with
/// a relative decrease below 1e-3 or one below `converged`, after ten rejected ones in a row, when
/// `abort` is raised, or when another iteration as long as the last would go beyond `limit`. What
/// was reached is kept. See docs/method/adjustment.md#stopping.
class BundleIterations final : public ceres::IterationCallback {
 public:
  /// The pointers may be nullptr: never.
  BundleIterations(int max_successful, double converged, const std::atomic<bool>* abort,
                   const TimeLimit* limit = nullptr)
      : max_successful_(max_successful), converged_(converged), abort_(abort), limit_(limit) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override;

  int successful() const { return successful_; }
  bool aborted() const { return aborted_; }
  bool timed_out() const { return timed_out_; }  ///< the limit ended it

 private:
  // Both return whether the minimisation is done.
  bool start(double cost);
  bool accept(double cost);

  int max_successful_;
  double converged_;
  const std::atomic<bool>* abort_;
  const TimeLimit* limit_;
  int successful_ = 0, rejected_ = 0, small_decreases_ = 0;
  double cost_ = 0;
  bool aborted_ = false, timed_out_ = false;
};

/// Whether there is a flag and it is set.
inline bool is_raised(const std::atomic<bool>* flag) { return flag != nullptr && flag->load(); }

}  // namespace orbslam
