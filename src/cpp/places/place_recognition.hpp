// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "map/map.hpp"
#include "places/keyframe_index.hpp"

namespace orbslam {

// These take the map's read lock themselves, in short sections, and never together with the
// index's lock. The caller must not hold it.

/// Adds a living keyframe; one that is dead, or dies meanwhile, does not stay in the index.
/// The caller that removes a keyframe from the map erases it from the index afterwards.
void index_keyframe(KeyFrameIndex& index, const Map& map, KeyFrameId id);

/// The lowest score between a keyframe and its covisible neighbours; 1 without neighbours. A loop
/// candidate must reach this score.
double lowest_neighbour_score(const Map& map, KeyFrameId id);

/// Keyframes that may close a loop with this one: not connected to it, and at least as similar as
/// `min_score`. Ascending ids, living ones only; none when the keyframe has died. See
/// docs/method/loops.md#detection.
std::vector<PlaceCandidate> find_loop_candidates(const KeyFrameIndex& index, const Map& map,
                                                 KeyFrameId id, double min_score);

/// Keyframes that may show the same place as a frame with words, for relocalization. Ascending ids,
/// living ones only. See docs/method/relocalization.md#candidates.
std::vector<PlaceCandidate> find_relocalization_candidates(const KeyFrameIndex& index,
                                                           const Map& map, const Frame& frame);

}  // namespace orbslam
