// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <vector>

namespace orbslam {

/// The smallest root above 0 of the polynomial sum c_i t^i; infinity if there is none.
double smallest_positive_root(std::vector<double> coefficients);

/// Value and derivative of a function of one variable.
struct ValueAndSlope {
  double value, slope;
};

/// Solves f(r) = target for r in [0, end) by Newton steps inside a shrinking bracket.
/// `function` gives a ValueAndSlope, is 0 at 0 and increases up to `end`, which may be infinite.
/// False if it does not reach the target.
template <class Function>
bool invert_increasing(const Function& function, double target, double end, double& r) {
  constexpr double kFarthest = 1e8;
  constexpr int kMostSteps = 200;
  if (!(target >= 0)) return false;
  double low = 0, high = std::isfinite(end) ? end : 1;
  while (!std::isfinite(end) && function(high).value <= target) {
    low = high;
    high *= 2;
    if (high > kFarthest) return false;
  }
  if (!(target < function(high).value)) return false;
  r = target > low && target < high ? target : 0.5 * (low + high);
  for (int step = 0; step < kMostSteps; ++step) {
    const ValueAndSlope at = function(r);
    if (at.value == target) return true;
    (at.value < target ? low : high) = r;
    double next = r - (at.value - target) / at.slope;
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (std::abs(next - r) <= 1e-16 * r) return true;
    r = next;
  }
  return true;  // the bracket is as small as the rounding of the function allows
}

}  // namespace orbslam
