// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "loops/loop.hpp"
#include "loops/loop_correction.hpp"
#include "map/map.hpp"

namespace orbslam {

/// The changes that merging makes to two maps, computed on copies. The younger map is moved into
/// the world of the older one, whose frame and scale stay. If only one map is upright, the other
/// one is moved into its world. Two upright maps keep roll and pitch (upright_correction()). See
/// docs/method/several_maps.md#merging.
///
/// The caller pauses local mapping from plan_map_merge() to apply_map_merge().
struct MapMerge {
  Loop loop;  ///< `current` and `matched` are of two maps
  std::uint64_t epoch = 0;
  MapIndex kept = kNoMap, moved = kNoMap;  ///< kNoMap: an end is dead, or both are of one map
  Similarity S_km;                         ///< world of the moved map to that of the kept one
  std::vector<LoopCorrection::Fusion> fusions;
  std::vector<KeyFrameId> group;  ///< `current` and its neighbours, whose connections change
};

/// Takes the map's read lock in short sections; the map is not changed. `fix_scale`: the similarity
/// is rigid.
MapMerge plan_map_merge(const Map& map, const Loop& loop, bool fix_scale);

struct MapMergeResult {
  bool applied = false;  ///< false: the map was cleared meanwhile, or an end has died
  MapIndex kept = kNoMap, moved = kNoMap;
  int n_moved_keyframes = 0, n_moved_points = 0;
  int n_fused = 0;   ///< points replaced or added
  double scale = 1;  ///< factor of lengths in the moved map
};

/// Moves one map into the other's world and makes them one map and one spanning tree with a loop
/// edge, in one write section, which counts as a big change; prepared under the read lock. Then
/// fuses points and brings connections up to date, in many short ones.
MapMergeResult apply_map_merge(Map& map, const MapMerge& merge);

/// The keyframes around the seam of two maps that have just become one: `current` and its
/// neighbours, ascending. Takes the read lock.
std::vector<KeyFrameId> keyframes_of_seam(const Map& map, KeyFrameId current);

/// The poses of all keyframes of a map.
struct KeyFramePoses {
  std::vector<KeyFrameId> ids;  ///< ascending
  std::vector<Pose> T_cw;
};
/// Published keyframes. Takes the read lock.
KeyFramePoses poses_of_map(const Map& map, MapIndex which);

/// Spreads the motion of an adjusted seam over the rest of the map. It solves a pose graph with the
/// relative poses of `before` and fixed poses of the seam. Points move with their reference
/// keyframes, those of the seam stay. Returns whether anything was moved. Takes the map's locks in
/// short sections. See docs/method/several_maps.md#the-seam.
bool spread_from_seam(Map& map, const KeyFramePoses& before, const std::vector<KeyFrameId>& seam,
                      bool fix_scale, const std::atomic<bool>* abort);

}  // namespace orbslam
