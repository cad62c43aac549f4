// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "frame/frame.hpp"
#include "map/map.hpp"

namespace orbslam {

/// Counts the points of one tracked frame. A point in view of the frame, or associated with it, is
/// counted as visible, once. An associated inlier is counted as found. `in_view`: the points that
/// the search of the local map found in the frustum. Dead and replaced points are left out. Takes
/// the read lock: counts grow while others read. See
/// docs/method/tracking.md#matching-the-local-map.
void count_sightings(const Map& map, const TrackedFrame& frame,
                     const std::vector<MapPointId>& in_view);

}  // namespace orbslam
