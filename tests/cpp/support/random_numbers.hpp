// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <random>

/// Random numbers that are the same on every platform.
namespace orbslam::testing {

/// Uniform in [0, 1).
inline double uniform(std::mt19937_64& random) {
  return static_cast<double>(random() >> 11) * 0x1.0p-53;
}
inline double uniform(std::mt19937_64& random, double low, double high) {
  return low + (high - low) * uniform(random);
}
/// Uniform in 0 .. n - 1 (n small against 2^64).
inline std::size_t uniform_index(std::mt19937_64& random, std::size_t n) {
  return static_cast<std::size_t>(random() % n);
}
/// Uniform in [-limit, limit].
inline double draw(std::mt19937_64& random, double limit) {
  return limit * (static_cast<double>(random() >> 11) * 0x1p-52 - 1.0);
}

}  // namespace orbslam::testing
