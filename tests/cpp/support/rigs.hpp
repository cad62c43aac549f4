// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <memory>

#include "support/cameras.hpp"

namespace orbslam::testing {

/// Where a camera that is turned about the vertical stands [degrees, m].
inline Pose mounted(double yaw, const Eigen::Vector3d& centre) {
  const Eigen::AngleAxisd turn(yaw * 3.14159265358979323846 / 180, Eigen::Vector3d::UnitY());
  return Pose(Eigen::Quaterniond(turn), centre);
}

/// Four cameras around a body, two pinholes (one with distortion) and two fisheye lenses; all
/// measure depths, with different baselines.
inline std::shared_ptr<const Camera> make_rig() {
  CameraOptions options;
  options.members = {
      {make_camera(TestLens::none, 40), Pose(), true},
      {make_camera(TestLens::fisheye, 24), mounted(90, {0.2, 0, -0.1}), true},
      {make_camera(TestLens::distorted, 55), mounted(180, {0, 0.05, -0.3}), true},
      {make_camera(TestLens::fisheye, 20), mounted(-90, {-0.2, 0, -0.1}), true},
  };
  return std::make_shared<Camera>(options);
}

}  // namespace orbslam::testing
