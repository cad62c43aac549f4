// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

namespace orbslam {

/// Uniform integers from a seed, the same on every platform (the standard's distributions are not).
class RandomIntegers {
 public:
  explicit RandomIntegers(std::uint64_t seed) : engine_(seed) {}
  /// In [0, count), unbiased; count > 0.
  std::uint64_t below(std::uint64_t count);

 private:
  std::mt19937_64 engine_;
};

/// Draws distinct indices out of [0, count).
class MinimalSampler {
 public:
  MinimalSampler(std::size_t count, std::uint64_t seed);

  std::size_t count() const { return indices_.size(); }
  /// Every ordered choice of `Size` indices is equally likely. Throws std::invalid_argument when
  /// there are fewer than `Size`.
  template <std::size_t Size>
  std::array<int, Size> draw() {
    std::array<int, Size> sample;
    draw(sample.data(), Size);
    return sample;
  }

 private:
  void draw(int* sample, std::size_t size);

  RandomIntegers random_;
  std::vector<int> indices_;
};

struct RansacOptions {
  double probability = 0.99;    ///< of drawing at least one sample without outliers; below 1
  std::size_t min_inliers = 0;  ///< a model needs as many
  double inlier_ratio = 0.5;    ///< assumed share of inliers
  int max_iterations = 300;
  /// Sample size assumed in the count of iterations. 3 whatever the sample, as in the original
  /// system: 35 iterations at a ratio of 0.5, where samples of 4 would ask for 72.
  int exponent = 3;
};

/// Iterations to run on `count` correspondences: in [1, max_iterations], 1 when all must be
/// inliers; 0 when there are fewer than min_inliers, so that no model can be found. See
/// docs/method/relocalization.md#pose-from-points.
int ransac_iterations(std::size_t count, const RansacOptions& options);

/// Throws std::invalid_argument, beginning with `what`, when an option or the gate max_chi2 is out
/// of range.
void check(const RansacOptions& options, double max_chi2, const char* what);

}  // namespace orbslam
