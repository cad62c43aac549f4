// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

namespace orbslam {

struct ImageSize {
  int width = 0;
  int height = 0;
};

/// The scale tables of an image pyramid. All entries are float32 on purpose: they enter keypoint
/// coordinates and must round the same way everywhere.
class ScalePyramid {
 public:
  /// `original_coordinates`: keypoints lie where the original puts them, at multiples of the scale,
  /// and not at their true place. Throws SettingsError unless 1 < factor <= 2, 1 <= levels <= 16.
  ScalePyramid(float factor, int levels, bool original_coordinates = false);

  int levels() const { return static_cast<int>(scale_factor_.size()); }
  float factor() const { return factor_; }
  float log_factor() const { return log_factor_; }
  /// The convention of keypoints on coarse levels (features/level_placement.hpp).
  bool original_coordinates() const { return original_coordinates_; }

  /// Size of one level-`level` pixel in level-0 pixels.
  float scale(int level) const { return scale_factor_[static_cast<std::size_t>(level)]; }
  float inverse_scale(int level) const { return inverse_scale_[static_cast<std::size_t>(level)]; }
  /// Variance of a keypoint's position in level-0 pixels^2.
  float sigma2(int level) const { return sigma2_[static_cast<std::size_t>(level)]; }
  float inverse_sigma2(int level) const { return inverse_sigma2_[static_cast<std::size_t>(level)]; }

  /// Size of a level, always computed from the level-0 size.
  ImageSize level_size(ImageSize level0, int level) const;
  /// How the wanted number of features is shared among the levels (geometric series).
  std::vector<int> features_per_level(int n_features) const;

  /// The level at which a point is expected that was seen at most `max_distance` away:
  /// ceil(ln(max_distance / distance) / ln factor), limited to the pyramid; 0 if that is no number.
  int predict_level(double max_distance, double distance) const;

 private:
  float factor_;
  float log_factor_;
  bool original_coordinates_;
  std::vector<float> scale_factor_, inverse_scale_, sigma2_, inverse_sigma2_;
};

}  // namespace orbslam
