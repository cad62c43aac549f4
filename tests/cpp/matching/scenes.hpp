// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "map/invariants.hpp"
#include "map/map.hpp"
#include "map/point_batch.hpp"
#include "support/synthetic_frames.hpp"

/// Small maps and frames for the tests of matching.
namespace orbslam::testing {

/// A point outside any map: seen from the origin, with wide distance limits.
inline MapPoint point(std::int64_t id, const Eigen::Vector3d& position,
                      const Descriptor& descriptor) {
  MapPoint made;
  made.id = MapPointId(id);
  made.position = position;
  made.mean_direction = position.normalized();
  made.min_distance = 0.01;
  made.max_distance = 1000;
  made.descriptor = descriptor;
  return made;
}

/// A point z metres in front of the origin.
inline MapPoint point_ahead(double z, double min_distance, double max_distance) {
  MapPoint ahead = point(0, {0, 0, z}, Descriptor());
  ahead.min_distance = min_distance;
  ahead.max_distance = max_distance;
  return ahead;
}

/// A feature on the middle row, with a thermometer descriptor.
inline FeatureSpec feature(std::int32_t level, int bits = 0, float u = 320, float depth = -1) {
  FeatureSpec spec;
  spec.u = u;
  spec.v = 240;
  spec.level = level;
  spec.depth = depth;
  spec.descriptor = thermometer_descriptor(bits);
  return spec;
}

/// All points of a cloud; ids are their indices.
inline PointBatch batch_of(const PointCloud& cloud) {
  PointBatch batch;
  for (std::size_t i = 0; i < cloud.positions.size(); ++i) {
    batch.push_back(point(static_cast<std::int64_t>(i), cloud.positions[i], cloud.descriptors[i]));
  }
  return batch;
}

/// A tracked frame whose keypoints hold the cloud's points they were projected from.
inline TrackedFrame associate_all(const ProjectedFrame& projected, const PointCloud& cloud,
                                  const Pose& T_cw) {
  TrackedFrame tracked(projected.frame);
  tracked.T_cw = T_cw;
  for (std::size_t i = 0; i < projected.points.size(); ++i) {
    const std::size_t index = projected.points[i];
    tracked.associate(i, MapPointId(static_cast<std::int64_t>(index)), cloud.positions[index]);
  }
  return tracked;
}

inline Pose small_motion(std::mt19937_64& random, double angle, double distance) {
  Vector6d xi;
  for (int i = 0; i < 3; ++i) xi[i] = uniform(random, -angle, angle);
  for (int i = 3; i < 6; ++i) xi[i] = uniform(random, -distance, distance);
  return Pose::exp(xi);
}

inline Pose at(double x, double y = 0, double z = 0) {
  return Pose(Eigen::Quaterniond::Identity(), -Eigen::Vector3d(x, y, z));
}

/// Gives every feature a vocabulary node, as describe() would.
inline void put_under_nodes(Frame& frame, const std::function<std::uint32_t(std::size_t)>& node) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> sorted;
  for (std::size_t i = 0; i < frame.size(); ++i) {
    sorted.emplace_back(node(i), static_cast<std::uint32_t>(i));
  }
  std::sort(sorted.begin(), sorted.end());
  DirectIndex& index = frame.direct_index;
  index = DirectIndex();
  for (const auto& [id, feature] : sorted) {
    if (index.nodes.empty() || index.nodes.back() != id) {
      index.nodes.push_back(id);
      index.offsets.push_back(static_cast<std::uint32_t>(index.indices.size()));
    }
    index.indices.push_back(feature);
  }
  if (!index.nodes.empty()) index.offsets.push_back(static_cast<std::uint32_t>(sorted.size()));
  frame.words.words.assign(index.nodes.begin(), index.nodes.end());
  frame.words.weights.assign(index.nodes.size(), 1.0 / static_cast<double>(frame.size()));
  frame.described = true;
}
inline void put_under_one_node(Frame& frame) {
  put_under_nodes(frame, [](std::size_t) { return 1U; });
}

/// A cloud of points and keyframes that look at it from positions of the caller's choice.
struct Scene {
  static constexpr std::uint32_t kNodes = 10;

  explicit Scene(std::size_t n, std::uint64_t seed, double half_width = 3)
      : cloud(make_point_cloud(n, half_width, 4, 10, seed)), points(n) {}

  /// A published keyframe without points.
  KeyFrameId add_keyframe(const Pose& T_cw, const ProjectionOptions& options = {},
                          std::shared_ptr<const Camera> camera = synthetic_camera()) {
    const auto id = static_cast<FrameId>(projected.size());
    projected.push_back(project_cloud(id, cloud, T_cw, options, std::move(camera)));
    const auto& seen = projected.back().points;
    put_under_nodes(*projected.back().frame,
                    [&](std::size_t i) { return static_cast<std::uint32_t>(seen[i]) % kNodes; });
    const KeyFrameId keyframe = map.add_keyframe(projected.back().frame, T_cw);
    map.publish(keyframe);
    return keyframe;
  }

  /// Lets a keyframe observe the points [begin, end) of the cloud as far as it sees them; they
  /// are added to the map when they are observed for the first time.
  void observe(KeyFrameId keyframe, std::size_t begin, std::size_t end) {
    const ProjectedFrame& seen = projected[static_cast<std::size_t>(keyframe.value)];
    for (std::size_t i = 0; i < seen.points.size(); ++i) {
      if (seen.points[i] < begin || seen.points[i] >= end) continue;
      MapPointId& id = points[seen.points[i]];
      id = map.resolve(id);
      if (!id.valid()) id = map.add_point(cloud.positions[seen.points[i]], keyframe, 0);
      map.add_observation(id, keyframe, i);
      map.update_point(id);
    }
    map.update_connections(keyframe);
  }
  /// The next observe() makes new points for [begin, end), duplicates of those in the map.
  void forget(std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) points[i] = MapPointId();
  }
  void observe_all(KeyFrameId keyframe) { observe(keyframe, 0, cloud.positions.size()); }

  void expect_consistent() const { EXPECT_THAT(check_invariants(map, true), ::testing::IsEmpty()); }

  PointCloud cloud;
  std::vector<MapPointId> points;  ///< per point of the cloud: its id in the map
  std::vector<ProjectedFrame> projected;
  Map map;
};

}  // namespace orbslam::testing
