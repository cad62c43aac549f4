// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/bundle_iterations.hpp"

#include "optimize/gates.hpp"

namespace orbslam {
namespace {

constexpr int kRejectedTrials = 10;

}  // namespace

ceres::CallbackReturnType BundleIterations::operator()(const ceres::IterationSummary& summary) {
  if (is_raised(abort_)) {
    aborted_ = true;
    return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
  }
  if (summary.iteration == 0) {
    cost_ = summary.cost;
    return ceres::SOLVER_CONTINUE;
  }
  if (!summary.step_is_successful) {
    return ++rejected_ >= kRejectedTrials ? ceres::SOLVER_TERMINATE_SUCCESSFULLY
                                          : ceres::SOLVER_CONTINUE;
  }
  rejected_ = 0;
  ++successful_;
  const double decrease = cost_ - summary.cost;
  const bool converged = decrease < converged_ * cost_;
  small_decreases_ = decrease < kSmallDecrease * cost_ ? small_decreases_ + 1 : 0;
  cost_ = summary.cost;
  const bool done =
      converged || successful_ >= max_successful_ || small_decreases_ >= kSmallDecreases;
  return done ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
}

}  // namespace orbslam
