// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "map/map.hpp"

namespace orbslam {

/// A state of a map, identified by the number of its last change.
struct MapStamp {
  std::uint64_t epoch = 0, keyframes = 0, points = 0;

  friend bool operator==(const MapStamp& a, const MapStamp& b) {
    return a.epoch == b.epoch && a.keyframes == b.keyframes && a.points == b.points;
  }
};

/// Ascending ids of changed objects. The removed ids may include objects that were created and
/// removed in between, and ids that are not used yet.
struct ChangedIds {
  MapStamp stamp;          ///< of the moment of the answer
  bool restarted = false;  ///< the map was cleared since; all living objects are listed
  std::vector<KeyFrameId> keyframes, keyframes_removed;
  std::vector<MapPointId> points, points_removed;
};

/// The present state. Takes the read lock.
MapStamp stamp_of(const Map& map);
/// The objects that have changed since; all objects for a default MapStamp(). Unpublished keyframes
/// count, the tracker's counters do not. Takes the read lock. See docs/method/map.md#changes.
ChangedIds changed_since(const Map& map, const MapStamp& since);

}  // namespace orbslam
