// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "loops/fusion_draft.hpp"
#include "loops/loop_correction.hpp"

namespace orbslam {

/// The keyframes that a loop corrects directly.
struct CorrectedGroup {
  std::vector<KeyFrameId> keyframes;  ///< `current` first
  std::vector<Similarity> corrected;  ///< S_iw of each
  std::vector<SharedPoints> shared;   ///< of each, with the fusions
  /// Keyframes outside of the group, that had not been neighbours, and share points with one of
  /// the group now: (of the group, other).
  std::vector<std::pair<KeyFrameId, KeyFrameId>> links;
};

/// Vertices, measurements and fixed vertex of a correction (Mur-Artal et al. 2015, section VII-D).
/// Vertices are all published keyframes of the map, those of the group at their corrected places.
/// Edges of the loop and its strong new links take their relative poses from the corrected group.
/// Edges of the spanning tree, of earlier loops and of strong covisibility take them from the map.
/// Covisibility is strong from Map::kEssentialWeight shared points on. A pair has one edge, the
/// first of these. The far end of the loop is fixed. Leaves the graph empty when an end of the loop
/// is dead or unpublished. Takes the read lock. See docs/method/loops.md#essential-graph.
void build_essential_graph(const Map& map, const CorrectedGroup& group, LoopCorrection& correction);

/// Index of an id among ascending ids, or -1.
std::ptrdiff_t vertex_of(const std::vector<KeyFrameId>& keyframes, KeyFrameId id);
/// The keyframe itself or the last one before it; the first one when there is none. The ids must
/// not be empty.
std::size_t vertex_before(const std::vector<KeyFrameId>& keyframes, KeyFrameId id);

}  // namespace orbslam
