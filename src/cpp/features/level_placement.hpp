// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "base/scale_pyramid.hpp"

namespace orbslam {

/// Where the columns, or the rows, of one level of an image pyramid lie in the image.
class LevelAxis {
 public:
  LevelAxis() = default;  ///< of level 0
  /// Column c lies at c * scale + offset of level 0.
  LevelAxis(float scale, float offset) : scale_(scale), inverse_(1.0F / scale), offset_(offset) {}

  /// Level-0 coordinate of a column or row of the level.
  float to_image(float coordinate) const { return coordinate * scale_ + offset_; }
  /// The reverse.
  float to_level(float coordinate) const { return (coordinate - offset_) * inverse_; }

 private:
  float scale_ = 1.0F, inverse_ = 1.0F, offset_ = 0.0F;
};

/// Where the pixels of one level of an image pyramid lie in the image. The pyramid aligns the
/// corners of its images, and their sizes are whole numbers: the centre of a level's pixel x lies
/// at (x + 0.5) * width / level's width - 0.5 of level 0. With the original's coordinates at x *
/// scale. See docs/method/features.md#result.
class LevelPlacement {
 public:
  LevelPlacement() = default;  ///< of level 0
  /// `level0`: size of the image.
  LevelPlacement(const ScalePyramid& scales, int level, ImageSize level0) {
    if (scales.original_coordinates()) {
      x = y = LevelAxis(scales.scale(level), 0.0F);
      return;
    }
    const ImageSize size = scales.level_size(level0, level);
    x = aligned(level0.width, size.width);
    y = aligned(level0.height, size.height);
  }

  LevelAxis x, y;

 private:
  static LevelAxis aligned(int of_image, int of_level) {
    if (of_level < 1) return {};  // the level is empty
    const float scale = static_cast<float>(of_image) / static_cast<float>(of_level);
    return {scale, 0.5F * (scale - 1.0F)};
  }
};

}  // namespace orbslam
