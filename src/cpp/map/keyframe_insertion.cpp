// SPDX-License-Identifier: BSD-3-Clause
#include "map/keyframe_insertion.hpp"

#include <algorithm>
#include <string>

#include "base/errors.hpp"
#include "map/anchor.hpp"

namespace orbslam {
namespace {

void create_depth_points(Map& map, KeyFrameId id, TrackedFrame& tracked, std::size_t n_minimum) {
  const Frame& frame = *tracked.frame;
  const Pose T_wc = tracked.T_cw->inverse();
  std::vector<std::uint32_t> nearest;
  nearest_keypoints(frame, n_minimum, nearest);
  for (const std::uint32_t i : nearest) {
    if (tracked.map_points[i].valid()) continue;
    const Eigen::Vector3d position = T_wc * frame.unproject(i);
    const MapPointId point = map.add_point(position, id, frame.id);
    map.add_observation(point, id, i);
    map.update_point(point);
    tracked.associate(i, point, position);
  }
}

/// Adds the observation of slot i to its point, or clears the slot. Returns whether the point was
/// created together with the keyframe.
bool settle_slot(Map& map, const KeyFrame& keyframe, std::size_t i) {
  const MapPointId noted = keyframe.map_points[i];
  if (!noted.valid()) return false;
  const MapPointId id = map.resolve(noted);
  const MapPoint* point = map.find(id);
  const Observation* observation = point ? point->observation_of(keyframe.id) : nullptr;
  if (observation) {
    // Another slot already holds the point: two matches became one when points were merged.
    if (observation->index != i) map.set_slot(keyframe.id, i, MapPointId());
    return observation->index == i && point->first_keyframe == keyframe.id;
  }
  if (noted != id) map.set_slot(keyframe.id, i, id);  // the successor, or nothing
  if (!point) return false;
  map.add_observation(id, keyframe.id, i);
  map.update_point(id);
  return false;
}

}  // namespace

KeyFrameId insert_keyframe(Map& map, TrackedFrame& frame, bool create_points,
                           std::size_t n_minimum) {
  if (!frame.T_cw) {
    throw StateError("a frame without a pose cannot become a keyframe; track it first");
  }
  const auto lock = map.write_lock();
  // A loop closed since the frame was tracked has moved everything but the frame.
  if (frame.anchor.big_change != map.big_change_index()) move_with_anchor(map, frame);
  const KeyFrameId id = map.add_keyframe(frame.frame, *frame.T_cw);
  frame.anchor = anchor_at(map, id);
  for (std::size_t i = 0; i < frame.map_points.size(); ++i) {
    if (!frame.map_points[i].valid()) continue;
    const MapPoint* point = map.find(map.resolve(frame.map_points[i]));
    if (!point) {
      frame.dissociate(i);
      continue;
    }
    frame.map_points[i] = point->id;
    map.set_slot(id, i, point->id);
  }
  if (create_points) create_depth_points(map, id, frame, n_minimum);
  return id;
}

void process_new_keyframe(Map& map, KeyFrameId id, std::vector<MapPointId>& recent) {
  const auto lock = map.write_lock();
  const KeyFrame* keyframe = map.find(id);
  if (!keyframe || keyframe->processed) {
    throw StateError("keyframe " + std::to_string(id.value) +
                     " is dead or was processed before; process each new keyframe once");
  }
  for (std::size_t i = 0; i < keyframe->map_points.size(); ++i) {
    if (settle_slot(map, *keyframe, i)) recent.push_back(keyframe->map_points[i]);
  }
  map.update_connections(id);
  map.publish(id);
  map.mark_processed(id);
}

int count_tracked_points(const Map& map, KeyFrameId id, int min_observations) {
  const auto lock = map.read_lock();
  const KeyFrame* keyframe = map.find(id);
  if (!keyframe) return 0;
  const auto counts = [&](MapPointId point_id) {
    const MapPoint* point = map.find(point_id);
    return point && point->observation_count >= min_observations;
  };
  return static_cast<int>(
      std::count_if(keyframe->map_points.begin(), keyframe->map_points.end(), counts));
}

}  // namespace orbslam
