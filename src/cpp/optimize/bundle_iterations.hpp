// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ceres/iteration_callback.h>

#include <atomic>

#include "optimize/bundle_stop_rule.hpp"

namespace orbslam {

/// Ends a minimisation of Ceres by BundleStopRule, when `abort` is raised, or when another
/// iteration as long as the last would exceed `limit`. The result so far is kept. See
/// docs/method/adjustment.md#stopping.
class BundleIterations final : public ceres::IterationCallback {
 public:
  /// The pointers may be nullptr: then they never end it.
  BundleIterations(int max_successful, double converged, const std::atomic<bool>* abort,
                   const TimeLimit* limit = nullptr)
      : rule_(max_successful, converged), abort_(abort), limit_(limit) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override;

  int successful() const { return rule_.successful(); }
  bool aborted() const { return aborted_; }
  bool timed_out() const { return timed_out_; }  ///< the limit ended it

 private:
  BundleStopRule rule_;
  const std::atomic<bool>* abort_;
  const TimeLimit* limit_;
  bool aborted_ = false, timed_out_ = false;
};

}  // namespace orbslam
