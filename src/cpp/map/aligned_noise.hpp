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

/// What is assumed of the aligned sightings of one camera: their positions, and their columns in the
/// right image.
class AlignedNoise {
 public:
  NoiseFactor position, right;

  /// The standard deviation of an aligned sighting over that of a corner of its level; 0: as the
  /// patches say, times the measured factors. Set before work begins.
  void assume(double over_corner) { over_corner_ = over_corner; }

  /// Inverse variance of an aligned number whose patch gives `variance`, where that of a corner has
  /// the inverse variance `corner` [pixels^-2]. It is never less than that of a corner.
  float weight(const NoiseFactor& factor, float variance, float corner) const {
    if (over_corner_ > 0) {
      return std::max(corner, corner / static_cast<float>(over_corner_ * over_corner_));
    }
    const double deviation = factor.value();
    const double weight = 1 / (deviation * deviation * static_cast<double>(variance));
    return std::max(corner, static_cast<float>(weight));
  }

  void forget() {
    position.forget();
    right.forget();
  }

 private:
  double over_corner_ = 1;
};

}  // namespace orbslam
