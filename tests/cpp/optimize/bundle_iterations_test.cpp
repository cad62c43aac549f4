// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/bundle_iterations.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace orbslam {
namespace {

TEST(BundleIterations, EndsInTheIterationInWhichTheFlagIsRaised) {
  std::atomic<bool> abort{false};
  BundleIterations rules(10, 0, &abort);
  ceres::IterationSummary iteration;
  iteration.cost = 100;
  EXPECT_EQ(rules(iteration), ceres::SOLVER_CONTINUE);
  iteration.iteration = 1;
  iteration.cost = 50;
  iteration.step_is_successful = true;
  EXPECT_EQ(rules(iteration), ceres::SOLVER_CONTINUE);
  abort = true;
  iteration.iteration = 2;
  EXPECT_EQ(rules(iteration), ceres::SOLVER_TERMINATE_SUCCESSFULLY);
  EXPECT_TRUE(rules.aborted());
  EXPECT_EQ(rules.successful(), 2);  // the step just taken counts: its estimate is kept
}

TEST(BundleIterations, EndsWhenAnotherIterationWouldGoBeyondTheLimit) {
  const TimeLimit limit(3600);
  BundleIterations rules(10, 0, nullptr, &limit);
  ceres::IterationSummary iteration;
  iteration.cost = 100;
  EXPECT_EQ(rules(iteration), ceres::SOLVER_CONTINUE);
  iteration.iteration = 1;
  iteration.cost = 50;
  iteration.step_is_successful = true;
  iteration.iteration_time_in_seconds = 60;
  EXPECT_EQ(rules(iteration), ceres::SOLVER_CONTINUE);
  EXPECT_FALSE(rules.timed_out());
  iteration.iteration = 2;
  iteration.cost = 25;
  iteration.iteration_time_in_seconds = 7200;
  EXPECT_EQ(rules(iteration), ceres::SOLVER_TERMINATE_SUCCESSFULLY);
  EXPECT_TRUE(rules.timed_out());
  EXPECT_FALSE(rules.aborted());
  EXPECT_EQ(rules.successful(), 2);  // the steps taken count
}

TEST(BundleIterations, TheLastIterationIsNotEndedByTheLimit) {
  const TimeLimit limit(0);
  BundleIterations rules(1, 0, nullptr, &limit);
  ceres::IterationSummary iteration;
  iteration.iteration = 1;
  iteration.step_is_successful = true;
  EXPECT_EQ(rules(iteration), ceres::SOLVER_TERMINATE_SUCCESSFULLY);
  EXPECT_FALSE(rules.timed_out());
}

TEST(BundleIterations, EndsAfterThreeSmallDecreasesInARow) {
  BundleIterations rules(10, 0, nullptr);
  ceres::IterationSummary iteration;
  iteration.cost = 1000;
  rules(iteration);
  iteration.step_is_successful = true;
  std::vector<ceres::CallbackReturnType> returned;
  for (const double decrease : {0.5, 0.5, 20.0, 0.5, 0.5, 0.5}) {
    ++iteration.iteration;
    iteration.cost -= decrease;
    returned.push_back(rules(iteration));
  }
  for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(returned[i], ceres::SOLVER_CONTINUE);
  EXPECT_EQ(returned[5], ceres::SOLVER_TERMINATE_SUCCESSFULLY);
  EXPECT_FALSE(rules.aborted());
}

TEST(BundleIterations, CountsSuccessfulStepsOnlyAndGivesUpAfterTenRejections) {
  BundleIterations counting(2, 0, nullptr);
  ceres::IterationSummary iteration;
  iteration.cost = 1000;
  counting(iteration);
  for (const bool successful : {true, false, false}) {
    ++iteration.iteration;
    iteration.step_is_successful = successful;
    iteration.cost -= successful ? 100 : 0;
    EXPECT_EQ(counting(iteration), ceres::SOLVER_CONTINUE);
  }
  iteration.step_is_successful = true;
  iteration.cost -= 100;
  EXPECT_EQ(counting(iteration), ceres::SOLVER_TERMINATE_SUCCESSFULLY);
  EXPECT_EQ(counting.successful(), 2);

  BundleIterations rejecting(5, 0, nullptr);
  ceres::IterationSummary rejected;
  rejecting(rejected);
  rejected.step_is_successful = false;
  for (rejected.iteration = 1; rejected.iteration < 10; ++rejected.iteration) {
    EXPECT_EQ(rejecting(rejected), ceres::SOLVER_CONTINUE);
  }
  EXPECT_EQ(rejecting(rejected), ceres::SOLVER_TERMINATE_SUCCESSFULLY);
}

}  // namespace
}  // namespace orbslam
