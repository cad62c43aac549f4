// SPDX-License-Identifier: BSD-3-Clause
#include "map/snapshot.hpp"

#include <gtest/gtest.h>

#include "map/content_hash.hpp"
#include "map_builder.hpp"

namespace orbslam::testing {
namespace {

struct SmallMap : MapBuilder {
  SmallMap() {
    add_keyframes(3);
    add_points(2, kfs({0, 2}));
    add_points(16, kfs({1, 2}));
    map.update_connections(kf(2));
    add_keyframe(false);
  }
};

TEST(Snapshot, KeyframesArePublishedOnesWithPosesInTheWorld) {
  SmallMap small;
  const KeyFrameSnapshot snapshot = snapshot_keyframes(small.map);
  EXPECT_EQ(snapshot.ids, kfs({0, 1, 2}));
  EXPECT_EQ(snapshot.parents, (std::vector<KeyFrameId>{KeyFrameId(), kf(0), kf(1)}));
  EXPECT_DOUBLE_EQ(snapshot.timestamps[2], 2.0 / 30);
  EXPECT_EQ(snapshot.T_wc[2], (Matrix4{1, 0, 0, 2, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}));
}

TEST(Snapshot, EdgesAreThoseOfEnoughWeight) {
  SmallMap small;
  EdgeSnapshot edges = snapshot_edges(small.map);
  EXPECT_EQ(edges.a, kfs({1}));
  EXPECT_EQ(edges.b, kfs({2}));
  EXPECT_EQ(edges.weights, (std::vector<std::int32_t>{16}));
  edges = snapshot_edges(small.map, 2);
  EXPECT_EQ(edges.a, kfs({0, 1}));
  EXPECT_EQ(edges.weights, (std::vector<std::int32_t>{2, 16}));
}

TEST(Snapshot, PointsAndTheirObservations) {
  SmallMap small;
  small.map.erase_point(MapPointId(1));
  const PointSnapshot points = snapshot_map(small.map).points;
  ASSERT_EQ(points.ids.size(), 17U);
  EXPECT_EQ(points.ids[1], MapPointId(2));
  EXPECT_EQ(points.positions[1], (std::array<double, 3>{0, 0, 5}));
  EXPECT_EQ(points.observation_counts[1], 2);
  const ObservationSnapshot observations = snapshot_observations(small.map);
  EXPECT_EQ(observations.ids, points.ids);
  ASSERT_EQ(observations.offsets.size(), 18U);
  EXPECT_EQ(observations.offsets.back(), 34);
  EXPECT_EQ(observations.keyframes[2], kf(1));
  EXPECT_EQ(observations.keypoints[2], 0);
  EXPECT_EQ(observations.keyframes[3], kf(2));
  EXPECT_EQ(observations.keypoints[3], 2);
}

TEST(ContentHash, IsEqualForEqualMapsAndFollowsEveryChange) {
  SmallMap a, b;
  const auto hash = content_hash(a.map);
  EXPECT_EQ(hash, content_hash(b.map));
  a.map.count_visible(MapPointId(0));
  EXPECT_EQ(hash, content_hash(a.map)) << "the tracker's counters do not enter";
  const Pose pose = a.map.T_cw(kf(1));
  a.map.set_pose(kf(1), Pose(pose.rotation(), pose.translation() + Eigen::Vector3d(0, 0, 1e-15)));
  EXPECT_NE(hash, content_hash(a.map));
  a.map.set_pose(kf(1), pose);
  EXPECT_EQ(hash, content_hash(a.map));
  a.map.set_position(MapPointId(3), {0, 1e-15, 5});
  EXPECT_NE(hash, content_hash(a.map));
  b.map.add_observation(MapPointId(3), kf(0), 50);
  EXPECT_NE(hash, content_hash(b.map));
  const auto before = content_hash(b.map);
  b.map.set_parent(kf(2), kf(0));
  EXPECT_NE(before, content_hash(b.map));
}

}  // namespace
}  // namespace orbslam::testing
