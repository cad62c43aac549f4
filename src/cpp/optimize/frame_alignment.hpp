// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "frame/frame.hpp"
#include "map/map.hpp"
#include "optimize/pose_optimization.hpp"
#include "optimize/sighting_alignment.hpp"

namespace orbslam {

/// Aligns the inliers of a tracked frame to the patches of their points, at most `most` of them,
/// spread evenly over the keypoints: fills TrackedFrame::aligned for optimize_pose(). The frame
/// must have a pose and its images; otherwise nothing is done. Takes the read lock for a short
/// section. Returns counts by result. See
/// docs/method/alignment.md#tracked-frames.
AlignmentCounts align_frame(const Map& map, TrackedFrame& frame, std::size_t most);

/// optimize_pose(), and once more with aligned inliers (align_frame) where `most` is not 0 and the
/// pose has at least `fewest` inliers.
PoseEstimate optimize_aligned(const Map& map, TrackedFrame& frame, std::size_t most, int fewest);

}  // namespace orbslam
