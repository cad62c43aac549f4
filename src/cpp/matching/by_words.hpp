// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <utility>
#include <vector>

#include "frame/frame.hpp"
#include "map/map.hpp"

namespace orbslam {

/// Matches the points of a keyframe to a frame: each feature that has a living point is compared
/// with those features of the frame only that fall under the same vocabulary node. A match has at
/// most kDescriptorLow differing bits and fewer than `ratio` times those of the second best in the
/// node; a feature of the frame is used once. Matches whose rotation disagrees with the majority
/// are dropped. Replaces the frame's associations. Returns their number, 0 for a dead keyframe.
/// Takes the read lock while it copies. Throws StateError when a frame has not been described. See
/// docs/method/words.md#matching-by-words.
int match_keyframe_by_words(const Map& map, KeyFrameId keyframe, TrackedFrame& frame, float ratio);

inline constexpr int kDescriptorUnguided =
    64;  ///< most differing bits of those most alike on both sides

/// Matches the points of a keyframe to a frame without words: each feature that has a living point
/// is compared with all of the frame's. Those match that are most alike on both sides, by
/// kDescriptorUnguided bits at most and fewer than `ratio` times those of the second best. It takes
/// some fifty times as long as matching by words. It also finds features that have changed so much
/// that they belong to other nodes. Otherwise it works like matching by words. The frames need no
/// words. See docs/method/words.md#without-words.
int match_keyframe_by_descriptors(const Map& map, KeyFrameId keyframe, TrackedFrame& frame,
                                  float ratio);

/// By words between two keyframes, only for features with living points on both sides: pairs
/// (feature of a, feature of b), ascending feature of a, one to one. Empty when one is dead.
std::vector<std::pair<std::uint32_t, std::uint32_t>> match_keyframes_by_words(const Map& map,
                                                                              KeyFrameId a,
                                                                              KeyFrameId b,
                                                                              float ratio);

}  // namespace orbslam
