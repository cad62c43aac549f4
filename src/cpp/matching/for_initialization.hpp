// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "frame/frame.hpp"

namespace orbslam {

/// Searches the level-0 keypoints of `initial` among those of `current`, each within `window`
/// pixels of its entry in `previous` (one position per initial keypoint; updated to the matched
/// positions, so that the search follows a feature over several frames). A match has at most
/// kDescriptorLow differing bits and fewer than `ratio` times those of the second best; of two
/// initial keypoints that want the same one the more similar gets it. Matches whose rotation
/// disagrees with the majority are dropped. Returns per initial keypoint the index in `current` or
/// -1. Throws StateError when `previous` has another length. See docs/method/start.md#one-camera.
std::vector<int> match_for_initialization(const Frame& initial, const Frame& current,
                                          std::vector<Eigen::Vector2f>& previous, float window,
                                          float ratio);

}  // namespace orbslam
