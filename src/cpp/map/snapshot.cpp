// SPDX-License-Identifier: BSD-3-Clause
#include "map/snapshot.hpp"

namespace orbslam {
namespace {

/// The caller holds a lock.
MapIndex chosen(const Map& map, MapIndex which) {
  return which == kNoMap ? map.active_map() : which;
}

void copy_keyframes(const Map& map, MapIndex which, KeyFrameSnapshot& snapshot) {
  map.for_each_keyframe([&](const KeyFrame& keyframe) {
    if (!keyframe.published || keyframe.map != which) return;
    snapshot.ids.push_back(keyframe.id);
    snapshot.T_wc.push_back(row_major(keyframe.T_cw.inverse()));
    snapshot.timestamps.push_back(keyframe.frame->timestamp);
    snapshot.parents.push_back(keyframe.parent);
  });
}

void copy_points(const Map& map, MapIndex which, PointSnapshot& snapshot) {
  snapshot.ids.reserve(map.n_points());
  snapshot.positions.reserve(map.n_points());
  snapshot.observation_counts.reserve(map.n_points());
  map.for_each_point([&](const MapPoint& point) {
    if (!map.is_in(point, which)) return;
    const Eigen::Vector3d& p = point.position;
    snapshot.ids.push_back(point.id);
    snapshot.positions.push_back({p.x(), p.y(), p.z()});
    snapshot.observation_counts.push_back(point.observation_count);
  });
}

}  // namespace

Matrix4 row_major(const Pose& pose) {
  Matrix4 matrix;
  Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(matrix.data()) = pose.matrix();
  return matrix;
}

KeyFrameSnapshot snapshot_keyframes(const Map& map, MapIndex which) {
  KeyFrameSnapshot snapshot;
  const auto lock = map.read_lock();
  copy_keyframes(map, chosen(map, which), snapshot);
  return snapshot;
}

EdgeSnapshot snapshot_edges(const Map& map, int min_weight, MapIndex which) {
  EdgeSnapshot snapshot;
  const auto lock = map.read_lock();
  which = chosen(map, which);
  map.for_each_keyframe([&](const KeyFrame& keyframe) {
    if (!keyframe.published || keyframe.map != which) return;
    for (const auto& [other, weight] : keyframe.weights) {
      if (other < keyframe.id || weight < min_weight || !map.find(other)->published) continue;
      snapshot.a.push_back(keyframe.id);
      snapshot.b.push_back(other);
      snapshot.weights.push_back(weight);
    }
  });
  return snapshot;
}

MapSnapshot snapshot_map(const Map& map, MapIndex which) {
  MapSnapshot snapshot;
  const auto lock = map.read_lock();
  which = chosen(map, which);
  copy_keyframes(map, which, snapshot.keyframes);
  copy_points(map, which, snapshot.points);
  map.for_each_keyframe([&](const KeyFrame& keyframe) {
    if (keyframe.map != which) return;
    for (const KeyFrameId other : keyframe.loop_edges) {
      if (other < keyframe.id) continue;
      snapshot.loop_a.push_back(keyframe.id);
      snapshot.loop_b.push_back(other);
    }
  });
  return snapshot;
}

ObservationSnapshot snapshot_observations(const Map& map, MapIndex which) {
  ObservationSnapshot snapshot;
  const auto lock = map.read_lock();
  snapshot.offsets.push_back(0);
  which = chosen(map, which);
  map.for_each_point([&](const MapPoint& point) {
    if (!map.is_in(point, which)) return;
    snapshot.ids.push_back(point.id);
    for (const Observation& observation : point.observations) {
      snapshot.keyframes.push_back(observation.keyframe);
      snapshot.keypoints.push_back(static_cast<std::int32_t>(observation.index));
    }
    snapshot.offsets.push_back(static_cast<std::int64_t>(snapshot.keyframes.size()));
  });
  return snapshot;
}

}  // namespace orbslam
