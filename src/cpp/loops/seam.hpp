// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>

#include "loops/essential_graph.hpp"
#include "loops/fusion_draft.hpp"
#include "loops/loop.hpp"

namespace orbslam {

/// Both sides of a place seen again, and their common points, computed on copies.
struct Seam {
  std::uint64_t epoch = 0;
  MapIndex near_map = kNoMap, far_map = kNoMap;  ///< of `current` and of `matched`
  CorrectedGroup group;  ///< `current` and its neighbours, in the world of the far side
  FusionDraft draft;     ///< with all fusions
};

/// Propagates the similarity of a loop to the neighbours of `current`, along the relative poses
/// within that group. Finds the points that are the same on both sides: the loop's matches, and the
/// far side's points projected into every keyframe of the group. Both sides may be of one map or of
/// two. Nothing when an end is dead or unpublished. Takes the map's read lock. Throws
/// std::invalid_argument unless the loop has one match, or an invalid id, per keypoint of its
/// current keyframe. See docs/method/loops.md#fusion-across-the-loop.
std::optional<Seam> draft_seam(const Map& map, const Loop& loop, bool fix_scale);

}  // namespace orbslam
