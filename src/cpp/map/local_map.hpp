// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "frame/frame.hpp"
#include "map/point_batch.hpp"

namespace orbslam {

/// The part of the map around the current frame (Mur-Artal et al. 2015, section V-D).
struct LocalMap {
  std::vector<KeyFrameId> keyframes;
  PointBatch points;              ///< all points of the local keyframes, each once
  KeyFrameId reference_keyframe;  ///< shares most points with the frame; invalid without votes
};

/// Exchanges replaced points of the frame for their living successors, refreshes the copies of
/// positions, and drops associations with dead points. Of two keypoints whose points were merged
/// one keeps the survivor. Temporary points stay. The caller holds a lock.
void refresh_associations(const Map& map, TrackedFrame& frame);

/// Keyframes that observe points of the frame (each point votes for its observers, ascending ids),
/// then for each of these at most one of its ten best neighbours, one child and the parent, until
/// there are more than 80; and all points of these keyframes. The reference keyframe has most
/// votes, of equal ones the lowest id. Refreshes the frame's associations first
/// (refresh_associations()); temporary points have no vote. The frame is anchored at the reference
/// keyframe; should the map have moved as a whole since its pose was predicted, the pose follows
/// first. Takes the read lock once, so the result is one consistent view. See
/// docs/method/tracking.md#local-map.
LocalMap select_local_map(const Map& map, TrackedFrame& frame);

}  // namespace orbslam
