// SPDX-License-Identifier: BSD-3-Clause
// Map: several maps in one store. See docs/method/several_maps.md.
#include <string>

#include "base/errors.hpp"
#include "map/map.hpp"

namespace orbslam {

std::vector<MapIndex> Map::maps() const {
  std::vector<MapIndex> indices;
  for (const auto& [index, part] : parts_) {
    if (part.root.valid()) indices.push_back(index);
  }
  return indices;
}

MapIndex Map::map_of(KeyFrameId id) const {
  const KeyFrame* found = find(living(id));
  return found ? found->map : kNoMap;
}

MapIndex Map::map_of(MapPointId id) const {
  const MapPoint* found = find(resolve(id));
  return found ? map_of(found->reference_keyframe) : kNoMap;
}

bool Map::is_in(const MapPoint& point, MapIndex map) const {
  // Usually there is one map, and no look-up is needed.
  if (parts_.size() == 1) return parts_.begin()->first == map;
  const KeyFrame* reference = find(point.reference_keyframe);
  return reference && reference->map == map;
}

KeyFrameId Map::root(MapIndex map) const {
  const auto part = parts_.find(map);
  return part == parts_.end() ? KeyFrameId() : part->second.root;
}

std::size_t Map::n_keyframes_of(MapIndex map) const {
  const auto part = parts_.find(map);
  return part == parts_.end() ? 0 : part->second.n_published;
}

bool Map::is_upright(MapIndex map) const {
  const auto part = parts_.find(map);
  return part != parts_.end() && part->second.upright;
}

void Map::set_upright(MapIndex map) {
  const auto part = parts_.find(map);
  if (part != parts_.end()) part->second.upright = true;
}

MapIndex Map::begin_map() {
  if (parts_.at(active_map()).root.valid()) {
    parts_.emplace(++last_map_, Part());
    active_map_ = last_map_;
  }
  return active_map();
}

void Map::activate_map(MapIndex map) {
  if (!root(map).valid()) {
    throw StateError("map " + std::to_string(map) +
                     " holds no keyframes; one that does can become the active one");
  }
  if (!root(active_map()).valid()) parts_.erase(active_map());
  active_map_ = map;
  ++structure_version_;
}

std::vector<KeyFrameId> Map::erase_map(MapIndex map) {
  std::vector<KeyFrameId> dying, archived;
  std::vector<MapPointId> points;
  for_each_keyframe([&](const KeyFrame& keyframe) {
    if (keyframe.map == map) dying.push_back(keyframe.id);
  });
  for_each_point([&](const MapPoint& point) {
    if (is_in(point, map)) points.push_back(point.id);
  });
  for (const auto& entry : archive_) {
    if (map_of(entry.first) == map) archived.push_back(entry.first);
  }
  for (const KeyFrameId id : archived) archive_.erase(id);
  for (const MapPointId id : points) points_.erase(id);
  for (const KeyFrameId id : dying) {
    if (find(id)->published) --n_published_;
    keyframes_.erase(id);
  }
  parts_.erase(map);
  if (map == active_map()) {
    if (parts_.empty()) parts_.emplace(++last_map_, Part());
    active_map_ = parts_.rbegin()->first;
  }
  ++structure_version_;
  return dying;
}

/// Reverses the path to the root, so that the keyframe becomes the root.
void Map::make_root_of_tree(KeyFrame& keyframe) {
  KeyFrameId below = keyframe.id, at = keyframe.parent;
  keyframe.parent = KeyFrameId();
  while (at.valid()) {
    KeyFrame& above = changing(at);
    const KeyFrameId next = above.parent;
    KeyFrame& lower = changing(below);
    above.children.erase(below);
    lower.children.insert(at);
    above.parent = below;
    above.provisional_parent = false;
    below = at;
    at = next;
  }
}

void Map::join_maps(KeyFrameId child, KeyFrameId parent) {
  KeyFrame& joint = keyframe(child);
  const MapIndex from = joint.map, into = keyframe(parent).map;
  if (from == into) {
    throw StateError("keyframes " + std::to_string(child.value) + " and " +
                     std::to_string(parent.value) + " belong to the same map already");
  }
  make_root_of_tree(joint);
  parts_.at(into).n_published += parts_.at(from).n_published;
  keyframes_.for_each([&](const KeyFrame& keyframe) {
    if (keyframe.map == from) changing(keyframe.id).map = into;
  });
  parts_.erase(from);
  if (active_map() == from) active_map_ = into;
  link(joint, parent);
  ++geometry_version_;
}

}  // namespace orbslam
