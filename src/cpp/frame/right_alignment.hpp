// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "frame/frame.hpp"

namespace orbslam {

/// Aligns the right image of a rectified pair to the left one at every keypoint with a depth, which
/// match_stereo() gave: moves right columns and depths, and fills Frame::right_variance. A keypoint
/// whose patches do not agree keeps its column and depth. If the rows of the pair disagree, no
/// column is replaced and the images are released, so that no patch is aligned to this frame.
/// Returns how many were aligned. The frame must hold both images (Frame::images) and an
/// undistorted camera; otherwise nothing is done. See docs/method/alignment.md#right-columns.
int align_right_columns(Frame& frame, double bf, double max_disparity);

}  // namespace orbslam
