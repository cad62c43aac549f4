// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "frame/frame.hpp"
#include "map/map.hpp"
#include "map/point_batch.hpp"

namespace orbslam {

// Poses of frames are stored relative to a keyframe, because optimisation moves keyframes. The pose
// of the keyframe must be the one at the time of tracking. Otherwise a loop that was closed between
// tracking and storing would enter the relative pose. See docs/method/map.md#anchors.

/// Present pose of a keyframe, living or culled. The caller holds a lock. Throws StateError for an
/// unknown one.
Anchor anchor_at(const Map& map, KeyFrameId keyframe);

/// Makes the frame's pose relative to that keyframe. Takes the read lock.
void anchor_frame(const Map& map, TrackedFrame& frame, KeyFrameId keyframe);

/// Expresses the frame's pose in the present map. Returns the factor by which lengths around its
/// keyframe have been multiplied since. A frame without pose or anchor stays. The caller holds a
/// lock.
double move_with_anchor(const Map& map, TrackedFrame& frame);

/// Result of follow_map().
struct FollowedMap {
  PointBatch points;     ///< the points associated with the frame, in the order of its keypoints
  double stretched = 1;  ///< lengths around the frame have been multiplied by it
  /// The motion of the frame's pose, T_after T_before^-1. None without a pose, or if a loop has
  /// moved the map, because a loop corrects older errors.
  std::optional<Pose> moved;
};

/// Updates an earlier frame in one consistent view of the map. Its pose follows its anchor.
/// Replaced points are exchanged for their successors, dead points are dropped, and copied
/// positions are refreshed. Takes the read lock.
FollowedMap follow_map(const Map& map, TrackedFrame& frame);

}  // namespace orbslam
