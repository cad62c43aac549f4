// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "frame/frame.hpp"

namespace orbslam {

/// How well a pose fits all that was matched, what it calls an outlier too: the median of the
/// distances between keypoints and projected points, in standard deviations of the keypoints'
/// levels; zero without any match. Throws StateError when the frame has no pose. Where half of what
/// is in view moves by itself, this grows while the number of inliers may not. See
/// docs/method/tracking.md#evidence.
double median_match_error(const TrackedFrame& frame);

}  // namespace orbslam
