// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/bundle_iterations.hpp"

namespace orbslam {

ceres::CallbackReturnType BundleIterations::operator()(const ceres::IterationSummary& summary) {
  bool done = false;
  if (summary.iteration == 0) {
    rule_.start(summary.cost);
  } else {
    done = summary.step_is_successful ? rule_.accept(summary.cost) : rule_.reject();
  }
  aborted_ = is_raised(abort_);
  timed_out_ =
      !done && !aborted_ && limit_ != nullptr && limit_->left() < summary.iteration_time_in_seconds;
  return done || aborted_ || timed_out_ ? ceres::SOLVER_TERMINATE_SUCCESSFULLY
                                        : ceres::SOLVER_CONTINUE;
}

}  // namespace orbslam
