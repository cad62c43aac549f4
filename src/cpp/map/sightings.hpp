// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "frame/frame.hpp"
#include "map/map.hpp"

namespace orbslam {

/// Commits what tracking one frame says about its points (spec 08, section 7): a point in view of
/// the frame, or matched in it before the local map was searched, was visible; an associated point
/// that the pose optimisation kept was found. `in_view`: the points that the search of the local
/// map saw in the frustum. Takes the write lock.
void count_sightings(Map& map, const TrackedFrame& frame, const std::vector<MapPointId>& in_view);

}  // namespace orbslam
