// SPDX-License-Identifier: BSD-3-Clause
#include "map/map_rewrite.hpp"

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

void MapRewrite::prepare(const Map& map) {
  std::unordered_map<KeyFrameId, Eigen::Vector3d> center_of;
  map.for_each_keyframe([&](const KeyFrame& keyframe) {
    const Pose* moved = T_cw(keyframe.id);
    center_of.emplace(keyframe.id, moved ? moved->center() : keyframe.center());
  });
  std::vector<Eigen::Vector3d> centers;
  for (MovedPoint& moved : points_) {
    const MapPoint* point = map.find(moved.id);
    moved.n_observations = point ? point->observations.size() : 0;
    if (!point) continue;
    centers.clear();
    for (const Observation& observation : point->observations) {
      centers.push_back(center_of.at(observation.keyframe));
    }
    moved.geometry = map.geometry_at(*point, moved.geometry.position, centers);
  }
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
