// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "frame/build_frame.hpp"

namespace orbslam {

/// Keypoints at the given pixels of an image of 80 x 60: cells of 10 pixels.
inline TrackedFrame tracked_frame_at(const std::vector<std::pair<float, float>>& pixels) {
  CameraOptions options;
  options.pinhole = {50, 50, 40, 30};
  options.image_size = {80, 60};
  Features features;
  for (const auto& [x, y] : pixels) {
    Keypoint keypoint;
    keypoint.x = x;
    keypoint.y = y;
    features.keypoints.push_back(keypoint);
    features.descriptors.emplace_back();
  }
  const FrameContext context{std::make_shared<Camera>(options),
                             std::make_shared<ScalePyramid>(1.2F, 8)};
  return TrackedFrame(build_monocular_frame(context, 0, 0, std::move(features)));
}

}  // namespace orbslam
