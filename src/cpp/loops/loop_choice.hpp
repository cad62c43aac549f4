// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>
#include <optional>
#include <vector>

#include "loops/loop.hpp"
#include "map/map.hpp"

namespace orbslam {

// Similar places far apart make perfect matches. What tells them from a place seen again is that
// the map would have to be wrong by more than it can be, or that the same view fits elsewhere too.

/// How far drift may have carried the map between the two keyframes of a loop, and how far the
/// loop says that it has. Lengths are in units of the map, around `current`.
///
/// The limits are several times what the drift usually is, and small against the distance between
/// places that look alike:
/// - max_translation: 4 % of the path, 2 % of the way that turning moves the image by
///   (scene_depth * turned), and what the loop's measurement itself may be off (10 % of
///   scene_depth). Without measured depth the scale drifts on top, which displaces `current` by at
///   most reach * |log scale| if it went one way (summation by parts of the steps along the path);
///   another 5 % may have come and gone.
/// - max_rotation: 0.1 rad + 3 % of `turned` + 0.01 rad per scene_depth of path; at most 60
///   degrees, so that corners of a building are never taken for one another.
/// - max_log_scale: 0 with measured depth; else log 1.5 + 0.01 per scene_depth of path.
struct LoopDrift {
  /// The way between the keyframes that drift can have moved least, along the covisibility graph,
  /// spanning tree and loop edges [m]; infinite when one of them is dead.
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
/// `matched`); nothing when two of them contradict each other: the view is ambiguous, and a wrong
/// loop costs more than a missed one. Two loops contradict each other when they put the keyframe
/// at places (position or orientation) that differ by more than drift between their far ends and
/// the error of both measurements can explain. Loops that drift cannot explain have no say: they
/// are other places that look the same. Takes the read lock while it copies.
/// Throws std::invalid_argument when the loops are not all of one keyframe. See
/// docs/method/loops.md#choice.
std::optional<Loop> choose_loop(const Map& map, const std::vector<Loop>& loops, bool fix_scale);

/// The same among places that one keyframe shows in other maps: no drift has to explain them.
/// Nothing when two of them are in different maps, or contradict each other. Takes the read lock
/// while it copies. See docs/method/several_maps.md#choice.
std::optional<Loop> choose_merge(const Map& map, const std::vector<Loop>& loops, bool fix_scale);

/// Whether a camera that was found at two keyframes of a map, with poses T_aw and T_bw, may be at
/// one place: drift between the keyframes and the error of both poses explain how far they are
/// apart. Lengths are those around `a`. Takes the read lock while it copies. See
/// docs/method/relocalization.md#another-place-that-fits.
bool may_be_one_place(const Map& map, KeyFrameId a, const Pose& T_aw, KeyFrameId b,
                      const Pose& T_bw, bool fix_scale);

}  // namespace orbslam
