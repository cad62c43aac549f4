// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "frame/frame.hpp"
#include "frame/nearest_keypoints.hpp"
#include "map/point_batch.hpp"

namespace orbslam {

/// In localization mode: makes a temporary point for each keypoint of the last frame with a depth
/// but no map point, so that the next frame can be tracked outside the map. It visits the keypoints
/// of nearest_keypoints(), with or without a map point: all close ones, and far ones until
/// `n_minimum` are passed, nearest first. `points` holds the last frame's map points
/// (gather_points). Temporary points are appended to it, as seen from the frame's pose. Ids are
/// kFirstTemporaryPoint plus the keypoint's index. They are valid for one pair of frames; older
/// temporary points in `last` are dropped first. Returns the number of points made. Throws
/// StateError when the frame has no pose. See docs/method/tracking.md#localization-mode.
std::size_t add_temporary_points(TrackedFrame& last, PointBatch& points,
                                 std::size_t n_minimum = kFewestDepthPoints);

/// Drops the associations with temporary points. Returns their number.
std::size_t discard_temporary(TrackedFrame& frame);

/// Number of associations with points of the map: all but the temporary ones, outliers included.
std::size_t count_map_points(const TrackedFrame& frame);

}  // namespace orbslam
