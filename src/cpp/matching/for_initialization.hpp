// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "frame/frame.hpp"

namespace orbslam {

/// Spec 06, 2.1: level-0 keypoints of `initial` searched in `current` around `previous` (x, y per
/// initial keypoint, updated to the matched positions). Returns per initial keypoint the index in
/// `current` or -1.
std::vector<int> match_for_initialization(const Frame& initial, const Frame& current,
                                          std::vector<Eigen::Vector2f>& previous, float window,
                                          float ratio);

}  // namespace orbslam
