// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "base/mix.hpp"

namespace orbslam::synthetic {

using orbslam::mix;
inline std::uint64_t mix(std::uint64_t a, std::uint64_t b) { return mix(mix(a) ^ b); }

/// Numbers drawn one after the other from a seed; the same on every platform.
class HashStream {
 public:
  explicit HashStream(std::uint64_t seed) : state_(seed) {}

  std::uint64_t next() { return mix(state_ += 0x9e3779b97f4a7c15ULL); }
  /// Uniform in [low, high).
  double uniform(double low, double high) {
    return low + (high - low) * static_cast<double>(next() >> 11) * 0x1p-53;
  }
  /// Uniform in 0..count - 1; count > 0 and small against 2^32.
  int below(int count) {
    return static_cast<int>(((next() >> 32) * static_cast<std::uint64_t>(count)) >> 32);
  }

 private:
  std::uint64_t state_;
};

}  // namespace orbslam::synthetic
