// SPDX-License-Identifier: BSD-3-Clause
#include "matching/temporary_points.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include "base/errors.hpp"

namespace orbslam {

std::size_t add_temporary_points(TrackedFrame& last, PointBatch& points, std::size_t n_minimum) {
  const Frame& frame = *last.frame;
  if (!last.T_cw) {
    throw StateError("add_temporary_points: frame " + std::to_string(frame.id) +
                     " has no pose; track it first");
  }
  // Their ids name keypoints of an older frame and would be taken for new ones.
  discard_temporary(last);
  const Pose T_wc = last.T_cw->inverse();
  const Eigen::Vector3d center = T_wc.translation();
  const ScalePyramid& scales = *frame.scales;

  thread_local std::vector<std::uint32_t> nearest;
  nearest_keypoints(frame, n_minimum, nearest);
  MapPoint point;
  std::size_t n_added = 0;
  for (const std::uint32_t i : nearest) {
    if (last.map_points[i].valid()) continue;
    point.id = MapPointId(kFirstTemporaryPoint.value + static_cast<std::int64_t>(i));
    point.position = T_wc * frame.unproject(i);
    const Eigen::Vector3d ray = point.position - center;
    const double distance = ray.norm();
    point.mean_direction = ray / distance;
    point.max_distance = distance * static_cast<double>(scales.scale(frame.keypoints[i].level));
    point.min_distance =
        point.max_distance / static_cast<double>(scales.scale(scales.levels() - 1));
    point.descriptor = frame.descriptors[i];
    points.push_back(point);
    last.associate(i, point.id, point.position);
    ++n_added;
  }
  return n_added;
}

std::size_t discard_temporary(TrackedFrame& frame) {
  std::size_t n_discarded = 0;
  for (std::size_t i = 0; i < frame.map_points.size(); ++i) {
    if (!is_temporary(frame.map_points[i])) continue;
    frame.dissociate(i);
    ++n_discarded;
  }
  return n_discarded;
}

std::size_t count_map_points(const TrackedFrame& frame) {
  return static_cast<std::size_t>(
      std::count_if(frame.map_points.begin(), frame.map_points.end(),
                    [](MapPointId id) { return id.valid() && !is_temporary(id); }));
}

}  // namespace orbslam
