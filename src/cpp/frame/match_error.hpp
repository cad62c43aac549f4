// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "frame/frame.hpp"

namespace orbslam {

/// Median reprojection error of all matches, outliers included, in standard deviations of the
/// keypoints' levels; zero without any match. Throws StateError when the frame has no pose. If half
/// of the scene in view moves, this error grows although the number of inliers may not change. See
/// docs/method/tracking.md#evidence.
double median_match_error(const TrackedFrame& frame);

}  // namespace orbslam
