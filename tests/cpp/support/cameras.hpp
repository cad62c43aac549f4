// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>

#include "camera/camera.hpp"

namespace orbslam::testing {

/// A camera of 640x480 pixels without a lens; bf in pixel metre.
inline std::shared_ptr<const Camera> make_camera(const Pinhole& pinhole, double bf = 0) {
  CameraOptions options;
  options.pinhole = pinhole;
  options.bf = bf;
  options.depth_ratio = 40;
  options.image_size = {640, 480};
  return std::make_shared<Camera>(options);
}

}  // namespace orbslam::testing
