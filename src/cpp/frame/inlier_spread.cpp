// SPDX-License-Identifier: BSD-3-Clause
#include "frame/inlier_spread.hpp"

#include <algorithm>
#include <bitset>
#include <cmath>

#include "base/errors.hpp"

namespace orbslam {

InlierSpread spread_of_inliers(const TrackedFrame& tracked) {
  if (!tracked.T_cw) {
    throw StateError("spread_of_inliers: the frame has no pose; inliers belong to one");
  }
  const Frame& frame = *tracked.frame;
  const ImageBounds& bounds = frame.camera->bounds();
  const float across = kSpreadColumns / (bounds.max_x - bounds.min_x);
  const float down = kSpreadRows / (bounds.max_y - bounds.min_y);
  const Eigen::RowVector3d axis = tracked.T_cw->rotation_matrix().row(2);
  const double z0 = tracked.T_cw->translation().z();

  constexpr int kOctaves = 64;
  std::bitset<kSpreadColumns * kSpreadRows> cells;
  std::bitset<kOctaves> octaves;
  for (std::size_t i = 0; i < frame.size(); ++i) {
    if (!tracked.map_points[i].valid() || tracked.outlier[i]) continue;
    const Keypoint& keypoint = frame.keypoints[i];
    const int column = static_cast<int>((keypoint.x - bounds.min_x) * across);
    const int row = static_cast<int>((keypoint.y - bounds.min_y) * down);
    cells.set(static_cast<std::size_t>(std::clamp(row, 0, kSpreadRows - 1) * kSpreadColumns +
                                       std::clamp(column, 0, kSpreadColumns - 1)));
    const double depth = axis.dot(tracked.positions[i]) + z0;
    if (!(depth > 0)) continue;
    octaves.set(
        static_cast<std::size_t>(std::clamp(std::ilogb(depth) + kOctaves / 2, 0, kOctaves - 1)));
  }
  return {static_cast<int>(cells.count()), static_cast<int>(octaves.count())};
}

int count_staying(const TrackedFrame& tracked, const Pose& T_nw) {
  const Frame& frame = *tracked.frame;
  const ImageBounds& bounds = frame.camera->bounds();
  const Pinhole& pinhole = frame.camera->pinhole();
  const Eigen::Matrix3d R = T_nw.rotation_matrix();
  int n = 0;
  for (std::size_t i = 0; i < frame.size(); ++i) {
    if (!tracked.map_points[i].valid() || tracked.outlier[i]) continue;
    const Eigen::Vector3d p = R * tracked.positions[i] + T_nw.translation();
    if (!(p.z() > 0)) continue;
    const Eigen::Vector2d pixel = pinhole.project(p);
    n += bounds.contains(pixel.x(), pixel.y()) ? 1 : 0;
  }
  return n;
}

}  // namespace orbslam
