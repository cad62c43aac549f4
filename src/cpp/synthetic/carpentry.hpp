// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "synthetic/world.hpp"

namespace orbslam::synthetic {

/// Puts rectangles together to walls, floors and boxes; every one gets its own texture, derived
/// from the seed and the number of rectangles before it. World axes: x right, y down, z forward.
class Carpenter {
 public:
  Carpenter(std::uint64_t seed, double texel) : seed_(seed), texel_(texel) {}

  /// An upright wall above the line from (x0, z0) to (x1, z1), between heights `top` and `bottom`
  /// (y, top < bottom).
  void wall(double x0, double z0, double x1, double z1, double top, double bottom,
            double repeat = 0);
  /// A horizontal rectangle at height y.
  void slab(double x0, double z0, double x1, double z1, double y);
  /// A box standing on y = bottom, turned by `yaw` about y: four sides and a lid.
  void box(double x, double z, double size_x, double size_z, double top, double bottom, double yaw);
  /// The four walls of an upright block.
  void block(double x0, double z0, double x1, double z1, double top, double bottom,
             double repeat = 0);

  void use_texel(double texel) { texel_ = texel; }

  std::vector<Rectangle>& rectangles() { return rectangles_; }

 private:
  std::uint64_t next_texture();

  std::uint64_t seed_;
  double texel_;
  std::vector<Rectangle> rectangles_;
};

}  // namespace orbslam::synthetic
