// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "map/point_batch.hpp"

namespace orbslam {

/// Spec 06, 2.10: projects points into a keyframe; where a keypoint matches, the point is added
/// to it or merged with the point that is there (the one with more observations survives). The
/// search runs without a lock on copies, the changes are made in one write section after checking
/// that everything still stands. Returns the number of changes.
int fuse_points(Map& map, KeyFrameId keyframe, const std::vector<MapPointId>& points,
                float radius_factor = 3.0F);

/// Spec 13, section 6: fuses the points of `current` with those of its neighbours (first and
/// second degree) in both directions, refreshes its points and its connections.
/// `n_neighbours`: 10, for a single camera 20. Returns the number of changes.
int fuse_with_neighbours(Map& map, KeyFrameId current, std::size_t n_neighbours);

}  // namespace orbslam
