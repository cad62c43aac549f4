// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "map/map.hpp"

namespace orbslam {

/// A moment in the life of a map, by its changes.
struct MapStamp {
  std::uint64_t epoch = 0, keyframes = 0, points = 0;

  friend bool operator==(const MapStamp& a, const MapStamp& b) {
    return a.epoch == b.epoch && a.keyframes == b.keyframes && a.points == b.points;
  }
};

/// Ids, ascending, of what has changed. Those removed may also name objects that came and went
/// meanwhile, and ids that have not been given yet.
struct ChangedIds {
  MapStamp stamp;          ///< of the moment of the answer
  bool restarted = false;  ///< the map was cleared since; all that lives is listed
  std::vector<KeyFrameId> keyframes, keyframes_removed;
  std::vector<MapPointId> points, points_removed;
};

/// The present moment. Takes the read lock.
MapStamp stamp_of(const Map& map);
/// What has changed since; everything since MapStamp(). Keyframes that are not published count, the
/// tracker's counters do not. Takes the read lock. See docs/method/map.md#changes.
ChangedIds changed_since(const Map& map, const MapStamp& since);

}  // namespace orbslam
