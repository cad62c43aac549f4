// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "features/orb_extractor.hpp"

namespace orbslam {

struct StereoMatches {
  std::vector<float> right_u;  ///< sub-pixel column in the right image, -1: none
  std::vector<float> depth;    ///< metres, -1: none
};

/// Throws ImageError that names the side unless the pyramid has the levels of all keypoints.
void check_extraction(const Extraction& extraction, const ScalePyramid& scales, const char* side);

/// Depth of the left keypoints of a rectified pair: descriptor search along rows, sliding 11x11
/// SAD window on the keypoint's level, parabola for the sub-pixel shift, removal of matches whose
/// SAD is above 2.1 times the median. bf in pixel metre, max_disparity in pixels (fx: depth of at
/// least one baseline). Both pyramids must have the levels of the keypoints, else ImageError. See
/// docs/method/frame.md#stereo-matching.
StereoMatches match_stereo(const Extraction& left, const Extraction& right,
                           const ScalePyramid& scales, double bf, double max_disparity);

}  // namespace orbslam
