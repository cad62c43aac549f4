// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>
#include <optional>
#include <vector>

#include "loops/loop.hpp"
#include "map/map.hpp"

namespace orbslam {

// Two places that look alike match perfectly. They are distinguished from a place seen again by two
// facts: the loop would need more drift than is possible, or the same view fits elsewhere too.

/// Largest possible drift between the two keyframes of a loop, and the drift that the loop
/// measures. Lengths are in units of the map, around `current`.
///
/// The limits are several times the usual drift, and small against the distance between places that
/// look alike:
/// - max_translation: 4 % of the path, 2 % of the way that turning moves the image by
///   (scene_depth * turned), and what the loop's measurement itself may be off (10 % of
/// scene_depth). Without measured depth the scale drifts on top, which displaces `current` by at
/// most reach * |log scale| if the scale changed in one direction (summation by parts of the steps
/// along the path); another 5 % allow for drift that was undone.
/// - max_rotation: 0.1 rad + 3 % of `turned` + 0.01 rad per scene_depth of path; at most 60
///   degrees, so that corners of a building are never taken for one another.
/// - max_log_scale: 0 with measured depth; else log 1.5 + 0.01 per scene_depth of path.
struct LoopDrift {
  /// Length [m] of the path between the keyframes with the least possible drift, along covisibility
  /// graph, spanning tree and loop edges; infinite when one of them is dead.
  double path = std::numeric_limits<double>::infinity();
  double turned = 0;       ///< radians turned along it
  double reach = 0;        ///< metres from `current` to the keyframe on it farthest away
  double scene_depth = 0;  ///< median of `current`'s points [m]
  double translation = 0;  ///< metres that the loop moves `current`
  double rotation = 0;     ///< radians that it turns it
  double scale = 1;        ///< of S_cm
  double max_translation = 0, max_rotation = 0, max_log_scale = 0;

  bool plausible() const;
};

/// Compares a loop's correction with what drift can explain. Takes the read lock while it copies.
LoopDrift assess_drift(const Map& map, const Loop& loop, bool fix_scale);

/// Among plausible loops of one keyframe the one with most matches (ties: the lower id of
/// `matched`); none when two of them contradict each other, because the view is then ambiguous and
/// a wrong loop does more harm than a missed one. Two loops contradict each other when they put the
/// keyframe at places (position or orientation) that differ by more than drift between their far
/// ends and the error of both measurements can explain. Loops that drift cannot explain are
/// ignored: they are other places that look the same. Takes the read lock while it copies. Throws
/// std::invalid_argument when the loops are not all of one keyframe. See
/// docs/method/loops.md#choice.
std::optional<Loop> choose_loop(const Map& map, const std::vector<Loop>& loops, bool fix_scale);

/// The same for places in other maps that match one keyframe. Drift does not limit them. Nothing
/// when two of them are in different maps, or contradict each other. Takes the read lock while it
/// copies. See docs/method/several_maps.md#choice.
std::optional<Loop> choose_merge(const Map& map, const std::vector<Loop>& loops, bool fix_scale);

/// Whether a camera that was found at two keyframes of a map, with poses T_aw and T_bw, may be at
/// one place: drift between the keyframes and the error of both poses explain how far they are
/// apart. Lengths are those around `a`. Takes the read lock while it copies. See
/// docs/method/relocalization.md#another-place-that-fits.
bool may_be_one_place(const Map& map, KeyFrameId a, const Pose& T_aw, KeyFrameId b,
                      const Pose& T_bw, bool fix_scale);

}  // namespace orbslam
