// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "map/snapshot.hpp"

namespace orbslam {

using KeyFramePair = std::array<KeyFrameId, 2>;
using KeyFramePairs = std::vector<KeyFramePair>;

/// The changes from the map of the last look to a later state of the map. A follower forgets
/// everything if `restarted`, drops the removed objects, and takes over the given ones. Ids ascend.
/// A given object may also be unchanged.
struct MapChanges {
  MapIndex map = 0;        ///< which one it is
  bool restarted = false;  ///< the first look, or another map, whose ids may start again
  KeyFrameSnapshot keyframes_set;
  std::vector<KeyFrameId> keyframes_removed;  ///< of those given before
  PointSnapshot points_set;
  std::vector<MapPointId> points_removed;  ///< of those given before
  // All pairs of published keyframes, ascending; none if they have not changed.
  std::optional<KeyFramePairs> covisibility;   ///< the lower id first
  std::optional<KeyFramePairs> loop_edges;     ///< the lower id first
  std::optional<KeyFramePairs> spanning_tree;  ///< keyframe and its parent
};

/// Reports at every look the changes of a map since the look before, and reads only those. After
/// many changes it releases the read lock every few thousand objects, so that no writer waits for
/// long. It then reads objects again that were changed in between, so the report agrees with one
/// state of the map. May be used from any thread. See docs/method/map.md#changes.
class MapFollower {
 public:
  /// `least_weight`: least number of shared points of a reported covisibility edge. `which`: the
  /// map that is followed; kNoMap: the map that is active at each look.
  explicit MapFollower(std::shared_ptr<const Map> map, int least_weight = Map::kEssentialWeight,
                       MapIndex which = kNoMap);

  MapChanges update();

 private:
  /// Edges of each published keyframe.
  struct Links {
    KeyFrameId parent;
    std::vector<KeyFrameId> strong, loops;  ///< with higher ids
  };
  struct Known {
    std::vector<std::uint64_t> seen;  ///< per page: its stamp when it was read
    std::vector<bool> told;           ///< per id: was reported
  };
  struct Pending;

  void restart(Pending& pending);
  bool look(Pending& pending, int budget);
  int look_at_keyframes(std::size_t page, Pending& pending);
  int look_at_points(std::size_t page, Pending& pending);
  void tell_edges(MapChanges& changes);

  std::shared_ptr<const Map> map_;
  int least_weight_;
  MapIndex which_;
  std::mutex mutex_;
  bool complete_ = false;  ///< the last look was complete
  std::uint64_t epoch_ = 0;
  MapIndex followed_ = kNoMap;
  Known keyframes_, points_;
  std::map<KeyFrameId, Links> links_;
  bool links_changed_ = false;
  KeyFramePairs covisibility_, loop_edges_, spanning_tree_;
};

}  // namespace orbslam
