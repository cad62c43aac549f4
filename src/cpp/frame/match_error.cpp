// SPDX-License-Identifier: BSD-3-Clause
#include "frame/match_error.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/errors.hpp"

namespace orbslam {

double median_match_error(const TrackedFrame& tracked) {
  if (!tracked.T_cw) {
    throw StateError("median_match_error: the frame has no pose; errors belong to one");
  }
  const Frame& frame = *tracked.frame;
  const Camera& camera = *frame.camera;
  const Eigen::Matrix3d R = tracked.T_cw->rotation_matrix();
  std::vector<double> squared;
  squared.reserve(frame.size());
  for (std::size_t i = 0; i < frame.size(); ++i) {
    if (!tracked.map_points[i].valid()) continue;
    const Keypoint& keypoint = frame.keypoints[i];
    const Eigen::Vector3d p = R * tracked.positions[i] + tracked.T_cw->translation();
    Eigen::Vector2d off;
    if (!camera.error(p, keypoint.x, keypoint.y, off)) {
      squared.push_back(std::numeric_limits<double>::infinity());
      continue;
    }
    const double weight = frame.scales->inverse_sigma2(keypoint.level);
    squared.push_back(weight * off.squaredNorm());
  }
  if (squared.empty()) return 0;
  const auto middle = squared.begin() + static_cast<std::ptrdiff_t>(squared.size() / 2);
  std::nth_element(squared.begin(), middle, squared.end());
  return std::sqrt(*middle);
}

}  // namespace orbslam
