// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstdint>
#include <utility>
#include <vector>

#include "loops/loop.hpp"
#include "map/map.hpp"
#include "optimize/pose_graph.hpp"

namespace orbslam {

/// The changes that closing a loop makes to the map, computed on copies. Other threads see the map
/// before or after the correction, never in between. See docs/method/loops.md#correction.
///
/// The caller pauses local mapping from plan_loop_correction() to apply_loop_correction().
struct LoopCorrection {
  Loop loop;
  std::uint64_t epoch = 0;
  MapIndex map = kNoMap;  ///< in which both ends are
  bool fix_scale = false;
  bool upright = false;  ///< moved by yaw and translation alone

  /// Changes of structure, to be carried out in this order.
  struct Fusion {
    MapPointId point;     ///< on the far side; survives
    MapPointId replaced;  ///< is replaced by it; invalid: `point` is added to the keypoint
    KeyFrameId keyframe;  ///< where they were found to be the same
    std::uint32_t keypoint = 0;
  };
  std::vector<Fusion> fusions;
  std::vector<KeyFrameId> group;  ///< `current` and its neighbours, whose connections change

  /// The essential graph: vertex k stands for keyframes[k] (ascending). Before
  /// optimize_essential_graph() its vertices are at the start of the optimisation, after it at the
  /// result. Empty when an end of the loop is dead.
  std::vector<KeyFrameId> keyframes;
  PoseGraph graph;
  std::vector<Similarity> uncorrected;  ///< of each vertex: its pose in the map

  /// All points of the map, ascending, and the vertex that each point moves with.
  std::vector<std::pair<MapPointId, std::uint32_t>> carried;
};

/// Propagates the loop's similarity to the group, along the relative poses within it. Finds the
/// points that are the same on both sides: the loop's matches, and the far side's points projected
/// into every corrected keyframe of the group. Builds the essential graph with the new links.
/// Points move with their FusionDraft::carrier(), or without one with their reference keyframe. In
/// an upright map (Map::is_upright()) keyframes keep roll and pitch, see upright_correction(). The
/// correction has no keyframes when an end of the loop is dead or unpublished. Takes the map's read
/// lock in short sections; the map is not changed. Throws std::invalid_argument unless the loop has
/// one match, or an invalid id, per keypoint of its current keyframe.
LoopCorrection plan_loop_correction(const Map& map, const Loop& loop, bool fix_scale);

/// Optimizes the graph of the correction in place (optimize_pose_graph()), without locks. Does
/// nothing for an empty graph. `abort` is polled once per iteration; nullptr: never. After an abort
/// the correction must not be applied.
PoseGraphSummary optimize_essential_graph(LoopCorrection& correction,
                                          const std::atomic<bool>* abort, int n_threads = 1);

struct LoopCorrectionResult {
  bool applied = false;  ///< false: the map was cleared meanwhile, or an end of the loop died
  int n_fused = 0;       ///< points replaced or added
  double translation = 0, rotation = 0;  ///< motion of `current` [m], [rad]
  double scale = 1;                      ///< factor of lengths around `current`
};

/// Fusions, poses, points, connections and the loop edge, in one write section, which counts as a
/// big change. Keyframes that were not planned for (the tracker may just have inserted one) follow
/// the keyframe before them. Prepared under the read lock. Nothing is changed when the map was
/// cleared meanwhile, an end of the loop has died or the correction is empty.
LoopCorrectionResult apply_loop_correction(Map& map, const LoopCorrection& correction);

}  // namespace orbslam
