// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "frame/frame.hpp"

namespace orbslam {

/// Parameters of the comparison of two views before there is a map.
struct ViewMatchOptions {
  float window = 100;        ///< half width around each expected position, level-0 pixels
  float ratio = 0.9F;        ///< best by second best distance; the second at another place
  int level_difference = 2;  ///< most levels between the keypoints of a match
  int highest_level = 3;     ///< positions on coarser levels are too inexact for the motion
};

/// Searches keypoints of `first` on levels up to `highest_level` among those of `current`, each
/// within `window` pixels of its expected position (one per keypoint of `first`). One corner may
/// give keypoints on several levels, so the second best counts only more than 2 pixels of its
/// level away from the best. A match has at most kDescriptorLow differing bits and fewer than
/// `ratio` times those of the second best; of two keypoints of `first` with the same match, the
/// more similar one keeps it; matches whose rotation disagrees with the majority are dropped.
/// Returns per keypoint of `first` the index in `current` or -1. Throws StateError when `expected`
/// has another length. See docs/method/start.md#matches-between-views.
std::vector<int> match_views(const Frame& first, const Frame& current,
                             const std::vector<Eigen::Vector2f>& expected,
                             const ViewMatchOptions& options);

}  // namespace orbslam
