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
/// before or after it and never between (spec 14, section 4 and 7.2).
///
/// The caller keeps local mapping still from plan_loop_correction() to apply_loop_correction().
struct LoopCorrection {
  Loop loop;
  std::uint64_t epoch = 0;
  bool fix_scale = false;

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

  /// All points, ascending, and the vertex that carries each along.
  std::vector<std::pair<MapPointId, std::uint32_t>> carried;
};

/// Propagates the loop's similarity to the group, finds which points are the same on both sides,
/// and builds the essential graph with the links that this makes (spec 14, 4.4 to 4.8; 16, 6).
/// Takes the map's read lock in short sections.
LoopCorrection plan_loop_correction(const Map& map, const Loop& loop, bool fix_scale);

/// Solves its graph. After an abort the correction must not be applied.
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
/// the keyframe before them.
LoopCorrectionResult apply_loop_correction(Map& map, const LoopCorrection& correction);

}  // namespace orbslam
