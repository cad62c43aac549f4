// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "camera/camera.hpp"
#include "geometry/motion_hypotheses.hpp"
#include "geometry/point_pairs.hpp"

namespace orbslam {

/// How well a motion is supported by pairs of pixels.
struct MotionSupport {
  std::size_t n_good = 0;  ///< pairs that triangulate in front of both cameras and reproject well
  double parallax = 0;  ///< degrees: the 51st largest of the good pairs, or the smallest if fewer
  std::vector<Eigen::Vector3d> points;  ///< per pair, frame of camera 1; zero where not good
  std::vector<std::uint8_t> good;       ///< per pair
  /// Good and with a parallax of more than 0.36 degrees (cosine below 0.99998): well placed.
  std::vector<std::uint8_t> triangulated;
};

/// Triangulates the pairs flagged in `inliers` and judges each. A pair is good when the squared
/// reprojection errors are at most `max_squared_error` [pixels^2] and both depths are positive;
/// with almost no parallax the sign of a depth is random and is not checked. See
/// docs/method/start.md#choosing-the-motion.
MotionSupport check_motion(const Motion& motion, const PointPairs& pairs,
                           const std::vector<std::uint8_t>& inliers, const Camera& camera,
                           double max_squared_error);

}  // namespace orbslam
