// SPDX-License-Identifier: BSD-3-Clause
// Map: life of points and the two sides of their observations.
#include <algorithm>
#include <string>
#include <utility>

#include "base/errors.hpp"
#include "map/map.hpp"

namespace orbslam {
namespace {

/// A point that loses an observation dies when its weighted count is not above this.
constexpr int kDyingCount = 2;

int weight_of(const Observation& observation) { return observation.has_depth ? 2 : 1; }

}  // namespace

const Observation* MapPoint::observation_of(KeyFrameId keyframe) const {
  const auto it = std::lower_bound(observations.begin(), observations.end(), keyframe, precedes);
  return it != observations.end() && it->keyframe == keyframe ? &*it : nullptr;
}

MapPointId Map::resolve(MapPointId id) const {
  while (id.valid() && !points_.find(id)) {
    const auto successor = replaced_by_.find(id);
    if (successor == replaced_by_.end()) return MapPointId();
    id = successor->second;
  }
  return id;
}

MapPointId Map::add_point(const Eigen::Vector3d& position, KeyFrameId reference,
                          FrameId first_frame) {
  keyframe(reference);
  auto added = std::make_unique<MapPoint>();
  const MapPointId id = next_point_;
  added->id = id;
  added->position = position;
  added->reference_keyframe = reference;
  added->first_keyframe = reference;
  added->first_frame = first_frame;
  points_.insert(id, std::move(added));
  ++next_point_.value;
  ++structure_version_;
  return id;
}

void Map::set_position(MapPointId id, const Eigen::Vector3d& position) {
  changing(id).position = position;
  ++geometry_version_;
}

void Map::set_geometry(MapPointId id, const PointGeometry& geometry) {
  MapPoint& moved = changing(id);
  moved.position = geometry.position;
  moved.mean_direction = geometry.mean_direction;
  moved.min_distance = geometry.min_distance;
  moved.max_distance = geometry.max_distance;
  ++geometry_version_;
}

void Map::insert_observation(MapPoint& observed, KeyFrame& observer, std::size_t index) {
  const Observation observation{observer.id, static_cast<std::uint32_t>(index),
                                observer.frame->has_depth(index)};
  auto& all = observed.observations;
  all.insert(std::lower_bound(all.begin(), all.end(), observer.id, precedes), observation);
  observed.observation_count += weight_of(observation);
  observer.map_points[index] = observed.id;
  points_.touch(observed.id);
}

void Map::add_observation(MapPointId point_id, KeyFrameId keyframe_id, std::size_t index) {
  MapPoint& observed = point(point_id);
  KeyFrame& observer = keyframe(keyframe_id);
  if (index >= observer.map_points.size()) {
    throw StateError("keyframe " + std::to_string(keyframe_id.value) + " has " +
                     std::to_string(observer.map_points.size()) + " keypoints, not a keypoint " +
                     std::to_string(index));
  }
  const MapPointId present = observer.map_points[index];
  if (present != point_id && find(present)) return;
  if (observed.observation_of(keyframe_id)) return;
  insert_observation(observed, observer, index);
  ++structure_version_;
}

void Map::erase_observation(MapPointId point_id, KeyFrameId keyframe_id) {
  MapPoint* observed = points_.find(point_id);
  if (!observed) return;
  auto& all = observed->observations;
  const auto it = std::lower_bound(all.begin(), all.end(), keyframe_id, precedes);
  if (it == all.end() || it->keyframe != keyframe_id) return;

  keyframe(keyframe_id).map_points[it->index] = MapPointId();
  observed->observation_count -= weight_of(*it);
  all.erase(it);
  points_.touch(point_id);
  ++structure_version_;
  if (observed->observation_count <= kDyingCount) {
    erase_point(point_id);
  } else if (observed->reference_keyframe == keyframe_id) {
    observed->reference_keyframe = all.front().keyframe;
  }
}

void Map::erase_point(MapPointId id) {
  const MapPoint* dying = find(id);
  if (!dying) return;
  for (const Observation& observation : dying->observations) {
    keyframe(observation.keyframe).map_points[observation.index] = MapPointId();
  }
  points_.erase(id);
  ++structure_version_;
}

void Map::replace_point(MapPointId id, MapPointId by) {
  const MapPoint* dying = find(id);
  const MapPointId survivor_id = resolve(by);
  if (!dying || !survivor_id.valid() || survivor_id == id) return;

  MapPoint& survivor = point(survivor_id);
  for (const Observation& observation : dying->observations) {
    KeyFrame& observer = keyframe(observation.keyframe);
    if (survivor.observation_of(observer.id)) {
      observer.map_points[observation.index] = MapPointId();
    } else {
      insert_observation(survivor, observer, observation.index);
    }
  }
  survivor.n_found.add(dying->n_found.value());
  survivor.n_visible.add(dying->n_visible.value());
  points_.erase(id);
  points_.touch(survivor_id);
  remember_replacement(id, survivor_id);
  refresh_descriptor(survivor);
  refresh_geometry(survivor);
  ++structure_version_;
}

void Map::set_patch(MapPointId id, std::shared_ptr<const PointPatch> patch) {
  MapPoint* owner = points_.find(id);
  if (!owner) return;
  owner->patch = std::move(patch);
  points_.touch(id);
}

void Map::set_aligned(KeyFrameId id, std::size_t index, const AlignedSighting& sighting) {
  KeyFrame* observer = keyframes_.find(id);
  if (!observer || observer->map_points[index] != sighting.point) return;
  if (observer->aligned.empty()) observer->aligned.resize(observer->map_points.size());
  observer->aligned[index] = sighting;
  keyframes_.touch(id);
}

void Map::clear_aligned(KeyFrameId id, std::size_t index) {
  KeyFrame* observer = keyframes_.find(id);
  if (!observer || observer->aligned.empty()) return;
  observer->aligned[index].variance = 0;
  keyframes_.touch(id);
}

void Map::remember_replacement(MapPointId id, MapPointId by) {
  replaced_by_[id] = by;
  replacements_.emplace_back(next_keyframe_, id);
}

void Map::forget_old_replacements() {
  // A link always points to a link that is younger, so dropping the oldest first never cuts a
  // chain in the middle.
  while (!replacements_.empty() &&
         next_keyframe_.value - replacements_.front().first.value > kReplacementMemory) {
    replaced_by_.erase(replacements_.front().second);
    replacements_.pop_front();
  }
}

void Map::count_visible(MapPointId id, int n) const {
  if (const MapPoint* counted = find(resolve(id))) counted->n_visible.add(n);
}

void Map::count_found(MapPointId id, int n) const {
  if (const MapPoint* counted = find(resolve(id))) counted->n_found.add(n);
}

}  // namespace orbslam
