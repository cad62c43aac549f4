// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "base/descriptor.hpp"

namespace orbslam {

/// One ORB keypoint. Coordinates are level-0 pixels, the centre of the top-left pixel is (0, 0).
/// See docs/method/features.md#pyramid.
struct Keypoint {
  float x = 0;
  float y = 0;
  float size = 0;      ///< diameter of the patch, level-0 pixels
  float angle = 0;     ///< degrees in [0, 360), clockwise because the y axis points down
  float response = 0;  ///< FAST score
  std::int32_t level = 0;
};
static_assert(sizeof(Keypoint) == 24);

/// Keypoints and their descriptors, same order and length.
struct Features {
  std::vector<Keypoint> keypoints;
  std::vector<Descriptor> descriptors;

  std::size_t size() const { return keypoints.size(); }
};

}  // namespace orbslam
