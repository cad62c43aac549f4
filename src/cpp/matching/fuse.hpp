// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "map/point_batch.hpp"

namespace orbslam {

/// Projects the living points among `points` that the keyframe does not observe yet into it. A
/// point is added to the keypoint that it matches, or merged with that keypoint's point. Of two
/// points the one with more observations survives, of equal ones the projected one. A point that
/// should be in view (expect_in_keyframe()) is searched within 3 pixels of its predicted level, on
/// that level or the next finer one. Its reprojection error must pass the chi-square gate. Of such
/// keypoints the one with the most similar descriptor matches, unless more than kDescriptorLow bits
/// differ. The search runs on copies without a lock. The changes are made in one write section, if
/// the map was not cleared, the keyframe has neither died nor moved, and the point lives.
/// Descriptors, directions and scale ranges are left to be refreshed. Returns the number of
/// changes, 0 for a dead keyframe.
int fuse_points(Map& map, KeyFrameId keyframe, const std::vector<MapPointId>& points);

/// Fuses the points of `current` with those of its best `n_neighbours` covisible keyframes (10, for
/// a single camera 20) and of five neighbours of each, as fuse_points() does: its points into all
/// of them, then all of theirs into it. Afterwards its points (descriptors, directions, scale
/// ranges) and its connections are refreshed. Takes short locks. If the map is cleared in between,
/// it stops. Returns the number of changes, 0 for a dead keyframe. See
/// docs/method/mapping.md#fusion.
int fuse_with_neighbours(Map& map, KeyFrameId current, std::size_t n_neighbours);

}  // namespace orbslam
