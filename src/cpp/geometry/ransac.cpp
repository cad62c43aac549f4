// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/ransac.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>

namespace orbslam {

std::uint64_t RandomIntegers::below(std::uint64_t count) {
  // 2^64 mod count low values are refused so that each remainder has the same number of sources.
  const std::uint64_t refused = (0 - count) % count;
  std::uint64_t value = engine_();
  while (value < refused) value = engine_();
  return value % count;
}

MinimalSampler::MinimalSampler(std::size_t count, std::uint64_t seed)
    : random_(seed), indices_(count) {
  std::iota(indices_.begin(), indices_.end(), 0);
}

void MinimalSampler::draw(int* sample, std::size_t size) {
  if (size > indices_.size()) {
    throw std::invalid_argument("a sample of " + std::to_string(size) + " needs as many items, " +
                                "there are " + std::to_string(indices_.size()));
  }
  // What was drawn moves behind the remaining ones; the next draw starts from any permutation.
  for (std::size_t k = 0; k < size; ++k) {
    const std::size_t remaining = indices_.size() - k;
    std::swap(indices_[random_.below(remaining)], indices_[remaining - 1]);
    sample[k] = indices_[remaining - 1];
  }
}

int ransac_iterations(std::size_t count, const RansacOptions& options) {
  if (count == 0 || count < options.min_inliers) return 0;
  if (count == options.min_inliers) return 1;
  const double needed = static_cast<double>(options.min_inliers) / static_cast<double>(count);
  const double ratio = std::max(options.inlier_ratio, needed);
  const double good_sample = std::pow(ratio, options.exponent);
  if (good_sample >= 1.0) return 1;
  const double iterations =
      std::ceil(std::log(1.0 - options.probability) / std::log1p(-good_sample));
  const int limit = std::max(1, options.max_iterations);
  // Not finite where no inliers are assumed.
  if (!(iterations < limit)) return limit;
  return std::max(1, static_cast<int>(iterations));
}

void check(const RansacOptions& options, double max_chi2, const char* what) {
  const bool valid = options.probability > 0 && options.probability < 1 &&
                     options.inlier_ratio >= 0 && options.inlier_ratio <= 1 &&
                     options.max_iterations >= 1 && options.exponent >= 1 && max_chi2 > 0;
  if (valid) return;
  throw std::invalid_argument(std::string(what) +
                              ": 0 < probability < 1, 0 <= inlier_ratio <= 1, max_iterations >= 1, "
                              "exponent >= 1 and max_chi2 > 0");
}

}  // namespace orbslam
