// SPDX-License-Identifier: BSD-3-Clause
#include "map/map_rewrite.hpp"

#include <algorithm>

namespace orbslam {

void MapRewrite::move_keyframe(KeyFrameId id, const Pose& T_cw, double rescaled) {
  const auto [slot, added] = slot_of_.try_emplace(id, keyframes_.size());
  if (added) keyframes_.emplace_back();
  keyframes_[slot->second] = {id, T_cw, rescaled};
}

void MapRewrite::move_point(MapPointId id, const Eigen::Vector3d& position) {
  MovedPoint moved;
  moved.id = id;
  moved.geometry.position = position;
  points_.push_back(moved);
}

const Pose* MapRewrite::T_cw(KeyFrameId id) const {
  const auto slot = slot_of_.find(id);
  return slot == slot_of_.end() ? nullptr : &keyframes_[slot->second].T_cw;
}

MapRewrite::Centers MapRewrite::centers_of(const Map& map) {
  Centers center_of;
  map.for_each_keyframe([&](const KeyFrame& keyframe) {
    const Pose* moved = T_cw(keyframe.id);
    rigs_ |= keyframe.frame->camera->is_rig();
    center_of.emplace(keyframe.id, moved ? moved->center() : keyframe.center());
  });
  return center_of;
}

void MapRewrite::prepare_point(const Map& map, const Centers& center_of, MovedPoint& moved) {
  moved.n_observations = 0;
  const MapPoint* point = map.find(moved.id);
  if (!point) return;
  centers_.clear();
  for (const Observation& observation : point->observations) {
    const auto center = center_of.find(observation.keyframe);
    if (center == center_of.end()) return;  // a keyframe that came meanwhile
    centers_.push_back(center->second);
    const KeyFrame* keyframe = rigs_ ? map.find(observation.keyframe) : nullptr;
    if (!keyframe) continue;
    const Pose* pose = T_cw(keyframe->id);
    centers_.back() = keyframe->frame->center_of(observation.index, pose ? *pose : keyframe->T_cw);
  }
  moved.n_observations = point->observations.size();
  moved.geometry = map.geometry_at(*point, moved.geometry.position, centers_);
}

void MapRewrite::prepare(const Map& map) {
  constexpr std::size_t kSlice = 1024;
  Centers center_of;
  {
    const auto lock = map.read_lock();
    center_of = centers_of(map);
  }
  for (std::size_t begin = 0; begin < points_.size(); begin += kSlice) {
    const std::size_t end = std::min(begin + kSlice, points_.size());
    const auto lock = map.read_lock();
    for (std::size_t i = begin; i < end; ++i) prepare_point(map, center_of, points_[i]);
  }
}

void MapRewrite::prepare_locked(const Map& map) {
  const Centers center_of = centers_of(map);
  for (MovedPoint& moved : points_) prepare_point(map, center_of, moved);
}

void MapRewrite::apply(Map& map) const {
  for (const MovedKeyFrame& moved : keyframes_) {
    if (!map.find(moved.id)) continue;
    map.set_pose(moved.id, moved.T_cw);
    if (moved.rescaled != 1) map.rescale(moved.id, moved.rescaled);
  }
  for (const MovedPoint& moved : points_) {
    const MapPoint* point = map.find(moved.id);
    if (!point) continue;
    if (moved.n_observations > 0 && moved.n_observations == point->observations.size()) {
      map.set_geometry(moved.id, moved.geometry);
    } else {
      map.set_position(moved.id, moved.geometry.position);
      map.update_geometry(moved.id);
    }
  }
}

}  // namespace orbslam
