// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <atomic>
#include <cmath>

namespace orbslam {

/// Ratio of two noises: the standard deviation of aligned pixels, divided by that of corners of the
/// same pyramid level. It begins at 1, with depths at 0.2; a single camera keeps 1. Each
/// measurement moves it a little (exponential mean of the logarithm). Any thread may read without a
/// lock; one thread writes.
class NoiseFactor {
 public:
  double value() const { return value_.load(std::memory_order_relaxed); }
  /// Inverse variance of an aligned sighting over that of a corner.
  float weight() const { return static_cast<float>(1 / (value() * value())); }
  int n_measured() const { return n_.load(std::memory_order_relaxed); }

  /// Ignores numbers that are not finite or not above 0.
  void measure(double factor) {
    if (!(std::isfinite(factor) && factor > 0)) return;
    const double old = std::log(value());
    const double measured = std::log(std::clamp(factor, kLeast, kMost));
    value_.store(std::exp(old + (measured - old) / kMemory), std::memory_order_relaxed);
    n_.store(n_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
  }
  /// Sets the value.
  void assume(double factor) { value_.store(factor, std::memory_order_relaxed); }
  /// As it was before.
  void restore(double factor, int n_measured) {
    assume(factor);
    n_.store(n_measured, std::memory_order_relaxed);
  }
  void forget() { restore(kMost, 0); }

 private:
  static constexpr double kMemory = 20;  ///< adjustments
  static constexpr double kLeast = 0.02, kMost = 1;

  std::atomic<double> value_{kMost};
  std::atomic<int> n_{0};
};

/// The ratios of one camera: for positions, and for columns in the right image.
struct NoiseFactors {
  NoiseFactor position, right;

  void forget() {
    position.forget();
    right.forget();
  }
};

}  // namespace orbslam
