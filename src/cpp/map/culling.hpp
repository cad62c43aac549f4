// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <vector>

#include "map/map.hpp"

namespace orbslam {

/// Removes recent points that were found in less than a quarter of the frames that should have seen
/// them, or that from the second keyframe after their own on have a weighted count of
/// `min_observations` or less; forgets those that lived to the third, and dead ones (Mur-Artal et
/// al. 2015, section VI-B). `current`: the newest keyframe; ids count the keyframes. Takes the
/// write lock. Returns the number of points killed; `recent` keeps those still under probation, in
/// order. See docs/method/mapping.md#culling-of-points.
int cull_recent_points(Map& map, KeyFrameId current, int min_observations,
                       std::vector<MapPointId>& recent);

/// Removes neighbours of `current` of whose points more than 90 % are seen by at least three other
/// keyframes at the same or a finer scale, one level of slack (Mur-Artal et al. 2015, section
/// VI-E). `only_close`, for sensors with depth: only points count whose depth was measured and is
/// close. Keyframe 0 stays; leases and loop edges protect (Map::erase_keyframe()). Each neighbour
/// is judged under the read lock, and again under the write lock before it dies. `is_needed`,
/// called under these locks, protects keyframes as well. Returns the keyframes that died. See
/// docs/method/mapping.md#culling-of-keyframes.
std::vector<KeyFrameId> cull_keyframes(Map& map, KeyFrameId current, bool only_close,
                                       const std::function<bool(KeyFrameId)>& is_needed = {});

}  // namespace orbslam
