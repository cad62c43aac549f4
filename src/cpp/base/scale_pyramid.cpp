// SPDX-License-Identifier: BSD-3-Clause
#include "base/scale_pyramid.hpp"

#include <algorithm>
#include <cmath>

#include "base/errors.hpp"

namespace orbslam {
namespace {
// Ties go to the even neighbour, which is what the default floating-point rounding mode does.
int round_half_even(float value) { return static_cast<int>(std::nearbyintf(value)); }
}  // namespace

ScalePyramid::ScalePyramid(float factor, int levels, bool original_coordinates)
    : factor_(factor), original_coordinates_(original_coordinates) {
  if (!(factor > 1.0F && factor <= 2.0F)) {
    throw SettingsError("scale factor between pyramid levels must be above 1 and at most 2, got " +
                        std::to_string(factor));
  }
  if (levels < 1 || levels > 16) {
    throw SettingsError("number of pyramid levels must be 1 to 16, got " + std::to_string(levels));
  }
  log_factor_ = static_cast<float>(std::log(static_cast<double>(factor)));
  float scale = 1.0F;
  for (int level = 0; level < levels; ++level) {
    scale_factor_.push_back(scale);
    sigma2_.push_back(scale * scale);
    inverse_scale_.push_back(1.0F / scale);
    inverse_sigma2_.push_back(1.0F / (scale * scale));
    scale *= factor;
  }
}

ImageSize ScalePyramid::level_size(ImageSize level0, int level) const {
  const float inverse = inverse_scale(level);
  return {round_half_even(static_cast<float>(level0.width) * inverse),
          round_half_even(static_cast<float>(level0.height) * inverse)};
}

std::vector<int> ScalePyramid::features_per_level(int n_features) const {
  const int n_levels = levels();
  const float ratio = 1.0F / factor_;
  float wanted = static_cast<float>(n_features) * (1.0F - ratio) /
                 (1.0F - static_cast<float>(std::pow(static_cast<double>(ratio), n_levels)));
  std::vector<int> quota(static_cast<std::size_t>(n_levels));
  int sum = 0;
  for (int level = 0; level + 1 < n_levels; ++level) {
    quota[static_cast<std::size_t>(level)] = round_half_even(wanted);
    sum += quota[static_cast<std::size_t>(level)];
    wanted *= ratio;
  }
  quota.back() = std::max(n_features - sum, 0);
  return quota;
}

int ScalePyramid::predict_level(double max_distance, double distance) const {
  const float ratio = static_cast<float>(max_distance / distance);
  const float level = std::ceil(std::log(ratio) / log_factor_);
  // NaN and numbers too large for an int must not be converted to int.
  if (!(level > 0.0F)) return 0;
  const int coarsest = levels() - 1;
  return level < static_cast<float>(coarsest) ? static_cast<int>(level) : coarsest;
}

}  // namespace orbslam
