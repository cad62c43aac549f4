// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "base/scale_pyramid.hpp"

namespace orbslam {

/// Where the pixels of one level of an image pyramid lie in the image: the pyramid aligns the
/// corners of its images, so the centre of the level's pixel x lies at (x + 0.5) * scale - 0.5 of
/// level 0; at x * scale with the original's coordinates. See docs/method/features.md#result.
class LevelPlacement {
 public:
  LevelPlacement() = default;  ///< of level 0
  LevelPlacement(const ScalePyramid& scales, int level)
      : scale_(scales.scale(level)),
        inverse_(scales.inverse_scale(level)),
        offset_(scales.original_coordinates() ? 0.0F : 0.5F * (scale_ - 1.0F)) {}

  /// Level-0 coordinate of a column or row of the level.
  float to_image(float coordinate) const { return coordinate * scale_ + offset_; }
  /// The reverse.
  float to_level(float coordinate) const { return (coordinate - offset_) * inverse_; }

 private:
  float scale_ = 1.0F, inverse_ = 1.0F, offset_ = 0.0F;
};

}  // namespace orbslam
