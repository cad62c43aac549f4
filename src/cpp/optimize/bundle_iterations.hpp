// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ceres/iteration_callback.h>

#include <atomic>

namespace orbslam {

/// Ends a minimisation by the rules of spec 16, 9.4: after `max_successful` successful steps, after
/// three in a row with a relative decrease below 1e-3 or one below `converged`, after ten rejected
/// ones in a row, or when `abort` is raised. What was reached is kept.
class BundleIterations final : public ceres::IterationCallback {
 public:
  BundleIterations(int max_successful, double converged, const std::atomic<bool>* abort)
      : max_successful_(max_successful), converged_(converged), abort_(abort) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override;

  int successful() const { return successful_; }
  bool aborted() const { return aborted_; }

 private:
  // Both return whether the minimisation is done.
  bool start(double cost);
  bool accept(double cost);

  int max_successful_;
  double converged_;
  const std::atomic<bool>* abort_;
  int successful_ = 0, rejected_ = 0, small_decreases_ = 0;
  double cost_ = 0;
  bool aborted_ = false;
};

inline bool is_raised(const std::atomic<bool>* flag) { return flag != nullptr && flag->load(); }

}  // namespace orbslam
