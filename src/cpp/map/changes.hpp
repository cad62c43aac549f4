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

/// What turns the map as it was at the last look into the map of one later moment: forget
/// everything if `restarted`, drop what was removed, take over what is set. Ids ascend. What is set
/// may also be as it was before.
struct MapChanges {
  MapIndex map = 0;        ///< which one it is
  bool restarted = false;  ///< the first look, or another map than before, whose ids may begin anew
  KeyFrameSnapshot keyframes_set;
  std::vector<KeyFrameId> keyframes_removed;  ///< of those given before
  PointSnapshot points_set;
  std::vector<MapPointId> points_removed;  ///< of those given before
  // All pairs of published keyframes, ascending, if they are not as before.
  std::optional<KeyFramePairs> covisibility;   ///< the lower id first
  std::optional<KeyFramePairs> loop_edges;     ///< the lower id first
  std::optional<KeyFramePairs> spanning_tree;  ///< keyframe and its parent
};

/// Tells at every look what has changed in a map since the look before, and looks at that only.
/// Where much has changed it gives the read lock back every few thousand objects, so that no writer
/// waits for long, and looks again at what was changed meanwhile: what it tells is the map of one
/// moment. May be used from any thread. See docs/method/map.md#changes.
class MapFollower {
 public:
  /// `least_weight`: shared points of two keyframes whose covisibility is told. `which`: the map
  /// that is followed; kNoMap: the active one, whichever that is.
  explicit MapFollower(std::shared_ptr<const Map> map, int least_weight = Map::kEssentialWeight,
                       MapIndex which = kNoMap);

  MapChanges update();

 private:
  /// What edges are made of, per published keyframe.
  struct Links {
    KeyFrameId parent;
    std::vector<KeyFrameId> strong, loops;  ///< with higher ids
  };
  struct Known {
    std::vector<std::uint64_t> seen;  ///< per page: its stamp when it was looked at
    std::vector<bool> told;           ///< per id: part of what was given
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
  bool complete_ = false;  ///< what was told is all that there was
  std::uint64_t epoch_ = 0;
  MapIndex followed_ = kNoMap;
  Known keyframes_, points_;
  std::map<KeyFrameId, Links> links_;
  bool links_changed_ = false;
  KeyFramePairs covisibility_, loop_edges_, spanning_tree_;
};

}  // namespace orbslam
