// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "synthetic/world.hpp"

namespace orbslam::synthetic {

/// The picture of a rectangle as a pyramid of bitmaps, each half the size of the one before.
///
/// The picture is a "dead leaves" image: half-transparent panels and polygons of random grey,
/// sizes in octaves from 2 m down to 3 cm (for a texel of 4 mm), small on top of large. Images of
/// this kind share their statistics with photographs, and look alike at all scales, so that
/// corners are found at every distance.
class Texture {
 public:
  explicit Texture(const Rectangle& rectangle);

  int levels() const { return static_cast<int>(levels_.size()); }
  double texel() const { return texel_; }

  /// Bilinear value [grey levels] of bitmap `level` at (u, v) [texels of level 0 from the
  /// rectangle's origin]; the border is repeated outwards.
  float sample(int level, float u, float v) const {
    const Level& bitmap = levels_[static_cast<std::size_t>(level)];
    const float x = clamp(u * bitmap.scale - 0.5F, bitmap.max_x);
    const float y = clamp(v * bitmap.scale - 0.5F, bitmap.max_y);
    const int x0 = static_cast<int>(x);
    const int y0 = static_cast<int>(y);
    const float fx = x - static_cast<float>(x0);
    const float fy = y - static_cast<float>(y0);
    const std::uint8_t* row = bitmap.data.data() + static_cast<std::size_t>(y0) * bitmap.stride +
                              static_cast<std::size_t>(x0);
    const std::uint8_t* below = row + bitmap.stride;
    const float top = mixed(row[0], row[1], fx);
    return top + fy * (mixed(below[0], below[1], fx) - top);
  }

 private:
  // Bitmaps carry one more row and column than they show, so that the right and lower neighbour
  // of the last pixel can be read.
  struct Level {
    int width, height;
    std::size_t stride;
    float scale, max_x, max_y;
    std::vector<std::uint8_t> data;
  };

  static float clamp(float value, float high) {
    return value < 0 ? 0.0F : (value > high ? high : value);
  }
  static float mixed(std::uint8_t a, std::uint8_t b, float f) {
    return static_cast<float>(a) +
           f * static_cast<float>(static_cast<int>(b) - static_cast<int>(a));
  }

  void add_level(int width, int height, const std::vector<std::uint8_t>& pixels);

  double texel_;
  std::vector<Level> levels_;
};

}  // namespace orbslam::synthetic
