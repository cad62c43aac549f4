// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/bundle_iterations.hpp"

#include "optimize/gates.hpp"

namespace orbslam {
namespace {

constexpr int kRejectedTrials = 10;

}  // namespace

ceres::CallbackReturnType BundleIterations::operator()(const ceres::IterationSummary& summary) {
  const bool done = summary.iteration == 0       ? start(summary.cost)
                    : summary.step_is_successful ? accept(summary.cost)
                                                 : ++rejected_ >= kRejectedTrials;
  aborted_ = is_raised(abort_);
  timed_out_ =
      !done && !aborted_ && limit_ != nullptr && limit_->left() < summary.iteration_time_in_seconds;
  return done || aborted_ || timed_out_ ? ceres::SOLVER_TERMINATE_SUCCESSFULLY
                                        : ceres::SOLVER_CONTINUE;
}

bool BundleIterations::start(double cost) {
  cost_ = cost;
  return false;
}

bool BundleIterations::accept(double cost) {
  const double decrease = cost_ - cost;
  const bool converged = decrease < converged_ * cost_;
  small_decreases_ = decrease < kSmallDecrease * cost_ ? small_decreases_ + 1 : 0;
  cost_ = cost;
  rejected_ = 0;
  ++successful_;
  return converged || successful_ >= max_successful_ || small_decreases_ >= kSmallDecreases;
}

}  // namespace orbslam
