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

/// What closing a loop does to the map, worked out on copies, so that everybody else sees the map
/// before or after it and never between. See docs/method/loops.md#correction.
///
/// The caller keeps local mapping still from plan_loop_correction() to apply_loop_correction().
struct LoopCorrection {
  Loop loop;
  std::uint64_t epoch = 0;
  MapIndex map = kNoMap;  ///< in which both ends are
  bool fix_scale = false;
  bool upright = false;  ///< moved by yaw and translation alone

  /// Changes of structure, to be carried out in this order.
  struct Fusion {
    MapPointId point;     ///< on the far side; survives
    MapPointId replaced;  ///< gives way to it; invalid: `point` is added to the keypoint
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
  std::vector<Similarity> uncorrected;  ///< of each vertex: where it is in the map

  /// All points of the map, ascending, and the vertex that carries each along.
  std::vector<std::pair<MapPointId, std::uint32_t>> carried;
};

/// Propagates the loop's similarity to the group, along the relative poses within it; finds which
/// points are the same on both sides (the loop's matches, and the far side's points projected into
/// every corrected keyframe of the group); and builds the essential graph with the links that this
/// makes. Points move with their FusionDraft::carrier(), those that have none with their reference
/// keyframe. In an upright map (Map::is_upright()) keyframes keep roll and pitch, see
/// upright_correction(). The correction has no keyframes when an end of the loop is dead or
/// unpublished. Takes the map's read lock in short sections; the map is not changed. Throws
/// std::invalid_argument unless the loop has one match, or an invalid id, per keypoint of its
/// current keyframe.
LoopCorrection plan_loop_correction(const Map& map, const Loop& loop, bool fix_scale);

/// Solves its graph in place (optimize_pose_graph()), without locks; nothing to do when it is
/// empty. `abort` is polled once per iteration; nullptr: never. After an abort the correction must
/// not be applied.
PoseGraphSummary optimize_essential_graph(LoopCorrection& correction,
                                          const std::atomic<bool>* abort, int n_threads = 1);

struct LoopCorrectionResult {
  bool applied = false;  ///< false: the map was cleared meanwhile, or an end of the loop died
  int n_fused = 0;       ///< points replaced or added
  double translation = 0, rotation = 0;  ///< by which `current` moved [m], [rad]
  double scale = 1;                      ///< by which lengths around `current` changed
};

/// Fusions, poses, points, connections and the loop edge, in one write section, which counts as a
/// big change. Keyframes that were not planned for (the tracker may just have inserted one) follow
/// the keyframe before them. Prepared under the read lock. Nothing is changed when the map was
/// cleared meanwhile, an end of the loop has died or the correction is empty.
LoopCorrectionResult apply_loop_correction(Map& map, const LoopCorrection& correction);

}  // namespace orbslam
