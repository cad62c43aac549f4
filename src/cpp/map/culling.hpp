// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "map/map.hpp"

namespace orbslam {

/// Spec 13, section 4: removes recent points that were found in less than a quarter of the frames
/// that should have seen them, or that two keyframes later have too few observations
/// (`min_observations` or less); forgets those that passed probation. Takes the write lock.
/// Returns the number of points killed; `recent` keeps those still under probation.
int cull_recent_points(Map& map, KeyFrameId current, int min_observations,
                       std::vector<MapPointId>& recent);

/// Spec 13, section 7: removes neighbours of `current` of whose (close) points more than 90 % are
/// seen by at least three other keyframes at the same or a finer scale. `only_close` for sensors
/// with depth. Takes the locks it needs. Returns the keyframes that died.
std::vector<KeyFrameId> cull_keyframes(Map& map, KeyFrameId current, bool only_close);

}  // namespace orbslam
