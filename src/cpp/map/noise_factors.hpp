// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <atomic>
#include <cmath>

namespace orbslam {

/// A factor on standard deviations that follows what is measured, robust and slow: its logarithm is
/// a running mean of the measured ones, the plain mean at first. Reading needs no lock; one thread
/// writes.
class NoiseFactor {
 public:
  double value() const { return value_.load(std::memory_order_relaxed); }
  int n_measured() const { return n_.load(std::memory_order_relaxed); }

  /// Ignores numbers that are not finite or not above 0.
  void measure(double factor) {
    if (!(std::isfinite(factor) && factor > 0)) return;
    const int n = std::min(n_.load(std::memory_order_relaxed) + 1, kMemory);
    const double limited = std::clamp(factor, kLeast, kMost);
    const double old = std::log(value());
    value_.store(std::exp(old + (std::log(limited) - old) / n), std::memory_order_relaxed);
    n_.store(n, std::memory_order_relaxed);
  }
  void forget() {
    value_.store(kFirst, std::memory_order_relaxed);
    n_.store(0, std::memory_order_relaxed);
  }

 private:
  static constexpr double kFirst = 2;  ///< before anything was measured
  static constexpr int kMemory = 20;   ///< adjustments
  static constexpr double kLeast = 0.3, kMost = 30;

  std::atomic<double> value_{kFirst};
  std::atomic<int> n_{0};
};

/// Of the aligned sightings of one camera: their positions, and their columns in the right image.
struct NoiseFactors {
  NoiseFactor position, right;

  void forget() {
    position.forget();
    right.forget();
  }
};

}  // namespace orbslam
