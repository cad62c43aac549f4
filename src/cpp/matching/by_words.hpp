// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <utility>
#include <vector>

#include "frame/frame.hpp"
#include "map/map.hpp"

namespace orbslam {

/// Spec 06, 2.2: points of a keyframe matched to a frame, only between features under the same
/// vocabulary node. Replaces the frame's associations. Returns their number.
int match_keyframe_by_words(const Map& map, KeyFrameId keyframe, TrackedFrame& frame, float ratio);

/// Spec 06, 2.3: pairs (feature of a, feature of b), ascending feature of a, both with points.
std::vector<std::pair<std::uint32_t, std::uint32_t>> match_keyframes_by_words(const Map& map,
                                                                              KeyFrameId a,
                                                                              KeyFrameId b,
                                                                              float ratio);

}  // namespace orbslam
