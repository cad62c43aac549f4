// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "frame/nearest_keypoints.hpp"
#include "map/map.hpp"

namespace orbslam {

/// Makes a keyframe of a tracked frame: copies pose and associations (outliers included, bundle
/// adjustment decides about them) and, if `create_points` (sensors with depth), makes map points
/// from the depths of keypoints that have none, among those of nearest_keypoints(): `n_minimum` or
/// all close ones, whichever is more. The first keyframe takes all: pass SIZE_MAX. New points are
/// associated with the tracked frame too. Temporary and dead points are dropped from the frame,
/// replaced points are exchanged for their successors. If the whole map has moved since tracking,
/// the frame follows it. It is then anchored at the new keyframe. Takes the write lock. Not
/// published: process_new_keyframe() does. Throws StateError when the frame has no pose. See
/// docs/method/tracking.md#new-keyframes.
KeyFrameId insert_keyframe(Map& map, TrackedFrame& frame, bool create_points,
                           std::size_t n_minimum = kFewestDepthPoints);

/// Adds the observations of points that the tracker matched (or of what has replaced them since),
/// refreshes those points, recomputes covisibility, publishes the keyframe, and appends the points
/// that were created with it to `recent` (Mur-Artal et al. 2015, section VI-A). Takes the write
/// lock. A keyframe may have been published before (monocular initialisation does), but not
/// processed: throws StateError, also for a dead one. See docs/method/mapping.md#insertion.
void process_new_keyframe(Map& map, KeyFrameId id, std::vector<MapPointId>& recent);

/// Number of living points of a keyframe with observation_count >= min_observations (0: all); 0 for
/// a dead keyframe. Takes the read lock.
int count_tracked_points(const Map& map, KeyFrameId id, int min_observations);

}  // namespace orbslam
