// SPDX-License-Identifier: BSD-3-Clause
#include "map/map.hpp"

#include <string>

#include "base/errors.hpp"

namespace orbslam {
namespace {

[[noreturn]] void throw_dead(const char* what, std::int64_t id) {
  throw StateError(std::string(what) + " " + std::to_string(id) +
                   " is not in the map: it was culled or never added; use the id of a living one");
}

}  // namespace

KeyFrame& Map::keyframe(KeyFrameId id) {
  KeyFrame* found = keyframes_.find(id);
  if (!found) throw_dead("keyframe", id.value);
  return *found;
}

const KeyFrame& Map::keyframe(KeyFrameId id) const {
  const KeyFrame* found = keyframes_.find(id);
  if (!found) throw_dead("keyframe", id.value);
  return *found;
}

MapPoint& Map::point(MapPointId id) {
  MapPoint* found = points_.find(id);
  if (!found) throw_dead("map point", id.value);
  return *found;
}

KeyFrame& Map::changing(KeyFrameId id) {
  KeyFrame& changed = keyframe(id);
  keyframes_.touch(id);
  return changed;
}

MapPoint& Map::changing(MapPointId id) {
  MapPoint& changed = point(id);
  points_.touch(id);
  return changed;
}

std::vector<KeyFrameId> Map::keyframe_ids() const {
  std::vector<KeyFrameId> ids;
  ids.reserve(keyframes_.size());
  keyframes_.for_each([&](const KeyFrame& keyframe) { ids.push_back(keyframe.id); });
  return ids;
}

std::vector<MapPointId> Map::point_ids() const {
  std::vector<MapPointId> ids;
  ids.reserve(points_.size());
  points_.for_each([&](const MapPoint& point) { ids.push_back(point.id); });
  return ids;
}

KeyFrameId Map::add_keyframe(std::shared_ptr<const Frame> frame, const Pose& T_cw) {
  auto added = std::make_unique<KeyFrame>();
  const KeyFrameId id = next_keyframe_;
  added->id = id;
  added->map_points.resize(frame->size());
  added->frame = std::move(frame);
  added->T_cw = T_cw;
  added->map = active_map();
  Part& part = parts_.at(added->map);
  if (!part.root.valid()) part.root = id;
  keyframes_.insert(id, std::move(added));
  ++next_keyframe_.value;
  forget_old_replacements();
  ++structure_version_;
  return id;
}

void Map::publish(KeyFrameId id) {
  KeyFrame& published = keyframe(id);
  if (published.published) return;
  published.published = true;
  keyframes_.touch(id);
  ++n_published_;
  ++parts_.at(published.map).n_published;
  ++structure_version_;
  if (published.parent.valid() || is_root(published)) return;

  // The root never dies, so a living ancestor always exists.
  const KeyFrameId root_id = root(published.map);
  KeyFrameId before(id.value - 1);
  for (; before > root_id; --before.value) {
    const KeyFrame* candidate = find(before);
    if (candidate && candidate->published && candidate->map == published.map &&
        !is_in_subtree(before, id)) {
      break;
    }
  }
  link(published, before);
  published.provisional_parent = true;
}

void Map::set_slot(KeyFrameId id, std::size_t index, MapPointId point_id) {
  KeyFrame& owner = keyframe(id);
  if (owner.published) {
    throw StateError("keyframe " + std::to_string(id.value) +
                     " is published; add_observation() and erase_observation() change its slots");
  }
  MapPointId& slot = owner.map_points.at(index);
  const MapPoint* present = find(slot);
  const Observation* observation = present ? present->observation_of(id) : nullptr;
  if (slot != point_id && observation && observation->index == index) {
    throw StateError("slot " + std::to_string(index) + " of keyframe " + std::to_string(id.value) +
                     " holds an observation; erase it first");
  }
  slot = point_id;
  ++structure_version_;
}

void Map::set_pose(KeyFrameId id, const Pose& T_cw) {
  changing(id).T_cw = T_cw;
  ++geometry_version_;
}

void Map::rescale(KeyFrameId id, double factor) { changing(id).scale *= factor; }

void Map::begin_lease(KeyFrameId id) { ++keyframe(id).leases; }

bool Map::end_lease(KeyFrameId id) {
  KeyFrame* leased = keyframes_.find(id);
  if (!leased) return false;
  if (leased->leases == 0) {
    throw StateError("keyframe " + std::to_string(id.value) +
                     " has no lease; begin_lease() and end_lease() must come in pairs");
  }
  if (--leased->leases > 0 || !leased->to_be_erased) return false;
  leased->to_be_erased = false;
  return leased->loop_edges.empty() && erase_keyframe(id);
}

ScaledPose Map::scaled_pose(KeyFrameId id) const {
  std::vector<const ArchivedKeyFrame*> chain;  // from the keyframe asked for up to a living one
  const KeyFrame* ancestor = find(id);
  for (KeyFrameId at = id; !ancestor; ancestor = find(at)) {
    const auto archived = archive_.find(at);
    if (archived == archive_.end()) {
      throw StateError("keyframe " + std::to_string(id.value) +
                       " never existed in this map; its pose is unknown");
    }
    chain.push_back(&archived->second);
    at = archived->second.parent;
  }
  ScaledPose found{ancestor->T_cw, ancestor->scale};
  for (auto dead = chain.rbegin(); dead != chain.rend(); ++dead) {
    const double stretched = found.scale / (*dead)->parent_scale;
    const Pose& T_kp = (*dead)->T_kp;
    found.T_cw = Pose(T_kp.rotation(), stretched * T_kp.translation()) * found.T_cw;
    found.scale = (*dead)->scale * stretched;
  }
  return found;
}

KeyFrameId Map::living(KeyFrameId id) const {
  while (!find(id)) {
    const auto archived = archive_.find(id);
    if (archived == archive_.end()) return KeyFrameId();
    id = archived->second.parent;
  }
  return id;
}

void Map::clear() {
  points_.clear();
  keyframes_.clear();
  archive_.clear();
  replaced_by_.clear();
  replacements_.clear();
  next_keyframe_ = KeyFrameId(0);
  next_point_ = MapPointId(0);
  n_published_ = 0;
  parts_ = {{++last_map_, {}}};
  active_map_ = last_map_;
  big_change_index_ = 0;
  noise_.forget();
  ++epoch_;
  ++structure_version_;
  ++geometry_version_;
}

}  // namespace orbslam
