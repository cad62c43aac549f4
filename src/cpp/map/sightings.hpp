// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "frame/frame.hpp"
#include "map/map.hpp"

namespace orbslam {

/// Commits what tracking one frame says about its points: a point in view of the frame, or
/// associated with it, was visible (once); an associated point that the pose optimisation kept was
/// found. `in_view`: the points that the search of the local map saw in the frustum. Points that
/// are dead or replaced by now are left out. Takes the read lock: counts grow while others read.
/// See docs/method/tracking.md#matching-the-local-map.
void count_sightings(const Map& map, const TrackedFrame& frame,
                     const std::vector<MapPointId>& in_view);

}  // namespace orbslam
