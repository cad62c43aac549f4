// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "synthetic/row_kernels.hpp"
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

  Texture(const Texture&) = delete;  // levels() points into it
  Texture& operator=(const Texture&) = delete;

  const TextureLevels& levels() const { return levels_; }
  double texel() const { return texel_; }

  /// Bilinear value [grey levels] of bitmap `level` at (u, v) [texels of level 0 from the
  /// rectangle's origin]; the border is repeated outwards.
  float sample(int level, float u, float v) const {
    const float scale = std::ldexp(1.0F, -level);
    const float x = clamp(u * scale - 0.5F, levels_.max_x[level]);
    const float y = clamp(v * scale - 0.5F, levels_.max_y[level]);
    const int x0 = static_cast<int>(x);
    const int y0 = static_cast<int>(y);
    const float fx = x - static_cast<float>(x0);
    const float fy = y - static_cast<float>(y0);
    const std::uint8_t* row =
        levels_.pixels + levels_.offset[level] + y0 * levels_.stride[level] + x0;
    const std::uint8_t* below = row + levels_.stride[level];
    const float top = mixed(row[0], row[1], fx);
    return top + fy * (mixed(below[0], below[1], fx) - top);
  }

 private:
  static float clamp(float value, float high) {
    return value < 0 ? 0.0F : (value > high ? high : value);
  }
  static float mixed(std::uint8_t a, std::uint8_t b, float f) {
    return static_cast<float>(a) +
           f * static_cast<float>(static_cast<int>(b) - static_cast<int>(a));
  }

  // Bitmaps carry one more row and column than they show, so that the right and lower neighbour
  // of the last pixel can be read.
  void add_level(int width, int height, const std::vector<std::uint8_t>& pixels);

  double texel_;
  std::vector<std::uint8_t> pixels_;
  TextureLevels levels_{};
};

}  // namespace orbslam::synthetic
