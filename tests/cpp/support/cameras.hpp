// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

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

/// The same image through a lens: radial-tangential distortion of a flat plane, or a fisheye lens
/// of about 150 degrees across (Kannala-Brandt).
enum class TestLens { none, distorted, fisheye };

inline std::shared_ptr<const Camera> make_camera(TestLens lens, double bf = 0) {
  if (lens == TestLens::none) return make_camera({480, 500, 320, 240}, bf);
  CameraOptions options;
  options.bf = bf;
  options.depth_ratio = 40;
  options.image_size = {640, 480};
  if (lens == TestLens::distorted) {
    options.pinhole = {480, 500, 320, 240};
    options.distortion = {-0.28, 0.07, 2e-4, 2e-5};
  } else {
    options.model = std::make_shared<CameraModel>(
        "kannala_brandt", std::vector<double>{230, 232, 318, 243, -0.01, 0.02, -0.01, 0.002},
        options.image_size);
  }
  return std::make_shared<Camera>(options);
}

constexpr TestLens kTestLenses[] = {TestLens::none, TestLens::distorted, TestLens::fisheye};

}  // namespace orbslam::testing
