// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "frame/frame.hpp"
#include "map/map.hpp"
#include "map/point_batch.hpp"

namespace orbslam {

// Poses of frames are kept relative to a keyframe, because optimisation moves keyframes. The pose
// of that keyframe must be the one of the map that the frame was tracked in: a loop closed between
// tracking and taking note would otherwise enter the relative pose. See docs/method/map.md#anchors.

/// A keyframe, living or culled, where it is now. The caller holds a lock. Throws StateError for an
/// unknown one.
Anchor anchor_at(const Map& map, KeyFrameId keyframe);

/// The frame's pose is relative to that keyframe from now on. Takes the read lock.
void anchor_frame(const Map& map, TrackedFrame& frame, KeyFrameId keyframe);

/// Expresses the frame's pose in the map as it is now. Returns by how much lengths around its
/// keyframe have been multiplied since. A frame without pose or anchor stays. The caller holds a
/// lock.
double move_with_anchor(const Map& map, TrackedFrame& frame);

/// What follow_map() found.
struct FollowedMap {
  PointBatch points;     ///< the points associated with the frame, in the order of its keypoints
  double stretched = 1;  ///< lengths around the frame have been multiplied by it
  /// The motion of the frame's pose, T_after T_before^-1; nothing without a pose, or where a loop
  /// has moved the map, which corrects an error of long before.
  std::optional<Pose> moved;
};

/// Brings an earlier frame up to date, in one consistent view of the map: its pose follows its
/// anchor, replaced points give way to their successors, dead ones are dropped, and copies of
/// positions are refreshed. Takes the read lock.
FollowedMap follow_map(const Map& map, TrackedFrame& frame);

}  // namespace orbslam
