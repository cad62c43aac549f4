// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/bundle_stop_rule.hpp"

#include "optimize/gates.hpp"

namespace orbslam {
namespace {

constexpr int kRejectedTrials = 10;

}  // namespace

bool BundleStopRule::accept(double cost) {
  const double decrease = cost_ - cost;
  const bool converged = decrease < converged_ * cost_;
  small_decreases_ = decrease < kSmallDecrease * cost_ ? small_decreases_ + 1 : 0;
  cost_ = cost;
  rejected_ = 0;
  ++successful_;
  return converged || successful_ >= max_successful_ || small_decreases_ >= kSmallDecreases;
}

bool BundleStopRule::reject() { return ++rejected_ >= kRejectedTrials; }

}  // namespace orbslam
