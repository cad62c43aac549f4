// SPDX-License-Identifier: BSD-3-Clause
#include "frame/frame.hpp"

#include <algorithm>

#include "base/errors.hpp"

namespace orbslam {

void TrackedFrame::clear_associations() {
  std::fill(map_points.begin(), map_points.end(), MapPointId());
  std::fill(positions.begin(), positions.end(), Eigen::Vector3d::Zero());
  std::fill(outlier.begin(), outlier.end(), std::uint8_t{0});
}

void TrackedFrame::copy_associations(const TrackedFrame& from,
                                     const std::vector<std::uint8_t>& keep) {
  if (from.frame != frame || keep.size() != map_points.size()) {
    throw StateError("associations can be copied only between versions of one frame");
  }
  for (std::size_t i = 0; i < map_points.size(); ++i) {
    if (keep[i] != 0 && from.map_points[i].valid()) {
      associate(i, from.map_points[i], from.positions[i]);
    } else {
      dissociate(i);
    }
  }
}

std::vector<MapPointId> TrackedFrame::discard_outliers() {
  std::vector<MapPointId> discarded;
  for (std::size_t i = 0; i < map_points.size(); ++i) {
    if (!map_points[i].valid() || outlier[i] == 0) continue;
    discarded.push_back(map_points[i]);
    dissociate(i);
  }
  std::sort(discarded.begin(), discarded.end());
  return discarded;
}

std::size_t TrackedFrame::n_associated() const {
  return static_cast<std::size_t>(std::count_if(map_points.begin(), map_points.end(),
                                                [](MapPointId point) { return point.valid(); }));
}

std::size_t TrackedFrame::n_map_inliers() const {
  std::size_t n = 0;
  for (std::size_t i = 0; i < map_points.size(); ++i) {
    n += map_points[i].valid() && !is_temporary(map_points[i]) && outlier[i] == 0 ? 1 : 0;
  }
  return n;
}

CloseCounts TrackedFrame::n_close_tracked_untracked() const {
  CloseCounts counts;
  for (std::size_t i = 0; i < frame->size(); ++i) {
    if (!frame->is_close(i)) continue;
    const bool tracked = map_points[i].valid() && outlier[i] == 0;
    ++(tracked ? counts.tracked : counts.untracked);
  }
  return counts;
}

}  // namespace orbslam
