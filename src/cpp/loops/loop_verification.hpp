// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>

#include "loops/loop.hpp"
#include "map/map.hpp"

namespace orbslam {

struct LoopVerificationOptions {
  bool fix_scale = false;  ///< where depth is measured
  std::uint64_t seed = 0;  ///< of the system; the draws depend on it and the two ids
  int min_word_matches = 20;
  int min_inliers = 20;  ///< of the refinement; RANSAC must find more
  int min_matches = 40;  ///< with the points around the candidate projected
};

/// Geometric verification of one candidate (Mur-Artal et al. 2015, section VII-B): matches by
/// words, similarity by RANSAC, guided matching both ways, refinement, projection of the points
/// that the candidate and its neighbours observe. If the refinement of a similarity keeps too few
/// inliers, RANSAC continues, until its iterations are used up or a few similarities have failed.
/// None when one of the two is dead, both are the same or a step finds too few matches. Takes the
/// map's read lock in short sections, between which others may change the map but not clear it; the
/// map is not changed. See docs/method/loops.md#verification.
std::optional<Loop> verify_loop_candidate(const Map& map, KeyFrameId current, KeyFrameId candidate,
                                          const LoopVerificationOptions& options);

}  // namespace orbslam
