// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "loops/loop.hpp"
#include "map/map.hpp"

namespace orbslam {

struct LoopVerificationOptions {
  bool fix_scale = false;  ///< where depth is measured
  std::uint64_t seed = 0;  ///< of the system; the draws depend on it and the two ids
  int min_word_matches = 20;
  int min_inliers = 20;  ///< of RANSAC and of the refinement
  int min_matches = 40;  ///< with the points around the candidate projected
};

/// Geometric verification of one candidate (spec 14, section 3): matches by words, similarity by
/// RANSAC, guided matching both ways, refinement, projection of the points around the candidate.
/// Nothing when one of the two is dead or a step finds too little. Takes the map's read lock in
/// short sections; the map is not changed.
std::optional<Loop> verify_loop_candidate(const Map& map, KeyFrameId current, KeyFrameId candidate,
                                          const LoopVerificationOptions& options);

/// How far the map says that drift may have carried it between two keyframes, and how far a loop
/// says that it has.
struct LoopDrift {
  double path = 0;         ///< metres along the covisibility graph, the shortest way
  double turned = 0;       ///< radians turned along it
  double scene_depth = 0;  ///< median of `current`'s points [m]
  double translation = 0;  ///< metres that the loop moves `current`
  double rotation = 0;     ///< radians that it turns it
  double scale = 1;        ///< of S_cm
  double max_translation = 0, max_rotation = 0, max_log_scale = 0;

  bool plausible() const;
};

/// Compares a loop's correction with what drift can explain. Similar places far apart make perfect
/// matches: what tells them from a place seen again is that the map would have to be wrong by more
/// than it can be. Takes the read lock.
LoopDrift assess_drift(const Map& map, const Loop& loop, bool fix_scale);

/// Among plausible loops of one keyframe the one with most matches (ties: the lower id of
/// `matched`); nothing when two of them contradict each other, i.e. would put the keyframe at
/// different places: the view is ambiguous, and a wrong loop costs more than a missed one.
std::optional<Loop> choose_loop(const Map& map, const std::vector<Loop>& loops);

}  // namespace orbslam
