// SPDX-License-Identifier: BSD-3-Clause
#include "map/invariants.hpp"

#include <algorithm>
#include <map>

namespace orbslam {
namespace {

std::string name(KeyFrameId id) { return "keyframe " + std::to_string(id.value); }
std::string name(MapPointId id) { return "point " + std::to_string(id.value); }

class Checker {
 public:
  Checker(const Map& map, bool require_words) : map_(map), require_words_(require_words) {}

  std::vector<std::string> run() {
    std::size_t n_published = 0;
    std::map<MapIndex, std::size_t> n_of_map;
    map_.for_each_point([this](const MapPoint& point) { check_point(point); });
    map_.for_each_keyframe([&](const KeyFrame& keyframe) {
      n_published += keyframe.published ? 1 : 0;
      n_of_map[keyframe.map] += keyframe.published ? 1 : 0;
      check_map(keyframe);
      check_slots(keyframe);
      check_covisibility(keyframe);
      check_tree(keyframe);
      check_loop_edges(keyframe);
      require(!require_words_ || keyframe.frame->described,
              [&] { return name(keyframe.id) + " carries no words"; });
    });
    require(n_published == map_.n_keyframes(), [&] {
      return std::to_string(n_published) + " keyframes are published but the map counts " +
             std::to_string(map_.n_keyframes());
    });
    check_maps(n_of_map);
    return std::move(violations_);
  }

 private:
  template <class Sentence>
  void require(bool holds, Sentence&& sentence) {
    if (!holds) violations_.push_back(sentence());
  }

  static std::string name_of_map(MapIndex map) { return "map " + std::to_string(map); }

  void check_maps(const std::map<MapIndex, std::size_t>& n_of_map) {
    const std::vector<MapIndex> maps = map_.maps();
    for (const MapIndex index : maps) {
      const auto counted = n_of_map.find(index);
      require(counted != n_of_map.end() && counted->second == map_.n_keyframes_of(index), [&] {
        return name_of_map(index) + " has no keyframes, or counts " +
               std::to_string(map_.n_keyframes_of(index)) + " published ones, which is wrong";
      });
    }
    const bool holds = map_.root(map_.active_map()).valid();
    require(holds || maps.empty() || maps.back() < map_.active_map(),
            [&] { return name_of_map(map_.active_map()) + " is active and has no keyframes"; });
  }

  /// The keyframe and all its neighbours, tree and loop edges belong to one map, which has a root.
  void check_map(const KeyFrame& keyframe) {
    const KeyFrame* root = map_.find(map_.root(keyframe.map));
    require(root && root->map == keyframe.map, [&] {
      return name(keyframe.id) + " belongs to " + name_of_map(keyframe.map) +
             ", which has no living root";
    });
    const auto require_same = [&](KeyFrameId other) {
      const KeyFrame* tied = map_.find(other);
      require(!tied || tied->map == keyframe.map, [&] {
        return name(keyframe.id) + " of " + name_of_map(keyframe.map) + " is tied to " +
               name(other) + " of another map";
      });
    };
    require_same(keyframe.parent);
    for (const auto& entry : keyframe.weights) require_same(entry.first);
    for (const KeyFrameId other : keyframe.loop_edges) require_same(other);
  }

  void check_point(const MapPoint& point) {
    int count = 0;
    MapIndex map = kNoMap;
    KeyFrameId previous;
    for (const Observation& observation : point.observations) {
      count += observation.has_depth ? 2 : 1;
      require(previous < observation.keyframe, [&] {
        return name(point.id) + " lists " + name(observation.keyframe) + " twice or out of order";
      });
      previous = observation.keyframe;
      const KeyFrame* observer = map_.find(observation.keyframe);
      require(observer, [&] {
        return name(point.id) + " is observed by dead " + name(observation.keyframe);
      });
      if (!observer) continue;
      require(map == kNoMap || map == observer->map,
              [&] { return name(point.id) + " is observed in two maps"; });
      map = observer->map;
      const bool holds = observation.index < observer->map_points.size() &&
                         observer->map_points[observation.index] == point.id;
      require(holds, [&] {
        return name(point.id) + " is observed by " + name(observer->id) + " in slot " +
               std::to_string(observation.index) + ", which does not hold it";
      });
      require(
          !holds || observer->frame->has_depth(observation.index) == observation.has_depth, [&] {
            return name(point.id) + " has the wrong kind of observation in " + name(observer->id);
          });
    }
    require(count == point.observation_count && count >= 1, [&] {
      return name(point.id) + " has observation_count " + std::to_string(point.observation_count) +
             " but observations worth " + std::to_string(count);
    });
    require(point.observation_of(point.reference_keyframe), [&] {
      return name(point.id) + " is not observed by its reference " + name(point.reference_keyframe);
    });
  }

  void check_slots(const KeyFrame& keyframe) {
    // Before publication a slot may hold a match whose observation is still to be added, and the
    // point may die or be replaced meanwhile; the other direction is checked with the points.
    if (!keyframe.published) return;
    for (std::size_t i = 0; i < keyframe.map_points.size(); ++i) {
      const MapPointId id = keyframe.map_points[i];
      if (!id.valid()) continue;
      const MapPoint* point = map_.find(id);
      const Observation* observation = point ? point->observation_of(keyframe.id) : nullptr;
      require(observation && observation->index == i, [&] {
        return name(keyframe.id) + " holds " + (point ? "" : "dead ") + name(id) + " in slot " +
               std::to_string(i) + " without being observed";
      });
    }
  }

  void check_covisibility(const KeyFrame& keyframe) {
    std::vector<std::pair<int, KeyFrameId>> expected;  // (-weight, id)
    std::pair<int, KeyFrameId> best{0, KeyFrameId()};
    for (const auto& [other, weight] : keyframe.weights) {
      require(other != keyframe.id && weight >= 1, [&] {
        return name(keyframe.id) + " has weight " + std::to_string(weight) + " to " + name(other);
      });
      require(map_.find(other) && map_.weight(other, keyframe.id) == weight, [&] {
        return "the weight " + std::to_string(weight) + " of " + name(keyframe.id) + " to " +
               name(other) + " is not mutual";
      });
      if (weight >= Map::kCovisibilityThreshold) expected.emplace_back(-weight, other);
      best = std::min(best, {-weight, other});
    }
    if (expected.empty() && best.second.valid()) expected.push_back(best);
    std::sort(expected.begin(), expected.end());
    const bool equal = std::equal(
        expected.begin(), expected.end(), keyframe.neighbours.begin(), keyframe.neighbours.end(),
        [](const auto& pair, KeyFrameId id) { return pair.second == id; });
    require(equal, [&] {
      return "the neighbours of " + name(keyframe.id) + " are not the sorted view of its weights";
    });
  }

  void check_tree(const KeyFrame& keyframe) {
    for (const KeyFrameId child : keyframe.children) {
      const KeyFrame* living = map_.find(child);
      require(living && living->parent == keyframe.id, [&] {
        return name(keyframe.id) + " lists " + name(child) +
               ", which is dead or has another parent";
      });
    }
    if (!keyframe.parent.valid()) {
      require(map_.is_root(keyframe) || !keyframe.published,
              [&] { return name(keyframe.id) + " has no parent"; });
      return;
    }
    const KeyFrame* parent = map_.find(keyframe.parent);
    require(parent && parent->children.count(keyframe.id) == 1, [&] {
      return "the parent of " + name(keyframe.id) + ", " + name(keyframe.parent) +
             ", is dead or does not know it";
    });
    std::size_t steps = 0;
    for (const KeyFrame* at = parent; at && steps <= n_living(); at = map_.find(at->parent)) {
      ++steps;
    }
    require(steps <= n_living(),
            [&] { return name(keyframe.id) + " is above itself in the tree"; });
  }

  void check_loop_edges(const KeyFrame& keyframe) {
    for (const KeyFrameId other : keyframe.loop_edges) {
      const KeyFrame* end = map_.find(other);
      require(end && other != keyframe.id && end->loop_edges.count(keyframe.id) == 1, [&] {
        return "the loop edge of " + name(keyframe.id) + " to " + name(other) + " is not mutual";
      });
    }
  }

  std::size_t n_living() {
    if (n_living_ == 0) map_.for_each_keyframe([this](const KeyFrame&) { ++n_living_; });
    return n_living_;
  }

  const Map& map_;
  bool require_words_;
  std::size_t n_living_ = 0;
  std::vector<std::string> violations_;
};

}  // namespace

std::vector<std::string> check_invariants(const Map& map, bool require_words) {
  const auto lock = map.read_lock();
  return Checker(map, require_words).run();
}

}  // namespace orbslam
