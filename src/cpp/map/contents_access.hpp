// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "map/map.hpp"

namespace orbslam {

/// Pose of a culled keyframe relative to its parent in the spanning tree.
struct ArchivedPose {
  KeyFrameId id, parent;
  Pose T_kp;
  double scale = 1, parent_scale = 1;
};

/// Access for copying and restoring a whole map, beside its public methods. The caller holds the
/// map's lock.
class MapContentsAccess {
 public:
  static KeyFrameId next_keyframe(const Map& map) { return map.next_keyframe_; }
  static MapPointId next_point(const Map& map) { return map.next_point_; }
  /// Ascending ids.
  static std::vector<ArchivedPose> archived(const Map& map);
  static bool is_archived(const Map& map, KeyFrameId id) { return map.archive_.count(id) > 0; }
  /// The same for one culled keyframe, relative to the root of its map.
  static ArchivedPose relative_to_root(const Map& map, KeyFrameId id);

  // Fills an empty map. Nothing is checked: see check_stored_map().
  static void set_next_ids(Map& map, KeyFrameId keyframe, MapPointId point);
  /// A published keyframe; its observations come with the points.
  static KeyFrame& add(Map& map, std::unique_ptr<KeyFrame> keyframe);
  /// A point with observations of which `has_depth` and the slots are still to be set.
  static MapPoint& add(Map& map, std::unique_ptr<MapPoint> point);
  static void add(Map& map, const ArchivedPose& removed);
  static void set_weight(Map& map, KeyFrameId a, KeyFrameId b, int weight);
  /// Children of all keyframes, and their neighbours by weight. Keyframes without a parent are the
  /// roots of maps, numbered from the active one on; that with most keyframes becomes active.
  static void finish(Map& map);
};

}  // namespace orbslam
