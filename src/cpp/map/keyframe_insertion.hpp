// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "frame/nearest_keypoints.hpp"
#include "map/map.hpp"

namespace orbslam {

/// Makes a keyframe of a tracked frame: copies pose and associations (outliers included, bundle
/// adjustment decides about them) and, for sensors with depth, creates map points from the
/// frame's depths: `n_minimum` or all close ones, whichever is more, nearest first (spec 08,
/// section 10; the first keyframe takes all, spec 07 A: pass SIZE_MAX). New points are associated
/// with the tracked frame too. Temporary points are dropped. Takes the write lock. Not published:
/// process_new_keyframe() does.
KeyFrameId insert_keyframe(Map& map, TrackedFrame& frame, bool create_points,
                           std::size_t n_minimum = kFewestDepthPoints);

/// Spec 13, section 3: adds the observations of points that the tracker matched, refreshes those
/// points, recomputes covisibility, publishes the keyframe, and appends the points that were
/// created with it to `recent`. Takes the write lock. A keyframe may have been published before
/// (monocular initialisation does), but not processed: throws StateError, also for a dead one.
void process_new_keyframe(Map& map, KeyFrameId id, std::vector<MapPointId>& recent);

/// Number of living points of a keyframe with observation_count >= min_observations (0: all).
int count_tracked_points(const Map& map, KeyFrameId id, int min_observations);

}  // namespace orbslam
