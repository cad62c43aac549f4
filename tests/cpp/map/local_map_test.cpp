// SPDX-License-Identifier: BSD-3-Clause
#include "map/local_map.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "map_builder.hpp"

namespace orbslam::testing {
namespace {

TEST(SelectLocalMap, VotedKeyframesComeByIdAndTheMostVotedIsTheReference) {
  MapBuilder builder;
  builder.add_keyframes(4);
  std::vector<MapPointId> seen = builder.add_points(2, kfs({3, 1}));
  const auto more = builder.add_points(3, kfs({2}));
  seen.insert(seen.end(), more.begin(), more.end());
  TrackedFrame frame = frame_seeing(builder.map, seen);
  const LocalMap local = select_local_map(builder.map, frame);
  ASSERT_GE(local.keyframes.size(), 3U);
  EXPECT_EQ(std::vector<KeyFrameId>(local.keyframes.begin(), local.keyframes.begin() + 3),
            kfs({1, 2, 3}));
  EXPECT_EQ(local.reference_keyframe, kf(2));
}

TEST(SelectLocalMap, ATieOfVotesGoesToTheLowestId) {
  MapBuilder builder;
  builder.add_keyframes(4);
  TrackedFrame frame = frame_seeing(builder.map, builder.add_points(2, kfs({3, 2})));
  EXPECT_EQ(select_local_map(builder.map, frame).reference_keyframe, kf(2));
}

// OD-72: nothing of the frame before stays.
TEST(SelectLocalMap, WithoutVotesItIsEmpty) {
  MapBuilder builder;
  builder.add_keyframes(2);
  const auto points = builder.add_points(2, kfs({0, 1}));
  TrackedFrame frame = frame_seeing(builder.map, points);
  for (const MapPointId id : points) builder.map.erase_point(id);
  const LocalMap local = select_local_map(builder.map, frame);
  EXPECT_TRUE(local.keyframes.empty());
  EXPECT_EQ(local.points.size(), 0U);
  EXPECT_FALSE(local.reference_keyframe.valid());
  EXPECT_EQ(frame.n_associated(), 0U);
}

TEST(SelectLocalMap, PointsComeInOrderOfKeyframesAndSlotsEachOnce) {
  MapBuilder builder;
  builder.add_keyframes(3);
  const auto first = builder.add_points(2, kfs({2}));
  const auto shared = builder.add_points(2, kfs({1, 2}));
  const auto last = builder.add_points(1, kfs({1}));
  TrackedFrame frame = frame_seeing(builder.map, shared);
  const LocalMap local = select_local_map(builder.map, frame);
  EXPECT_EQ(local.points.ids,
            (std::vector<MapPointId>{shared[0], shared[1], last[0], first[0], first[1]}));
  for (std::size_t i = 0; i < local.points.size(); ++i) {
    const MapPoint& point = *builder.map.find(local.points.ids[i]);
    EXPECT_EQ(local.points.positions[i], point.position);
    EXPECT_EQ(local.points.mean_directions[i], point.mean_direction);
    EXPECT_EQ(local.points.min_distances[i], point.min_distance);
    EXPECT_EQ(local.points.max_distances[i], point.max_distance);
    EXPECT_EQ(local.points.descriptors[i], point.descriptor);
  }
}

/// Keyframe 0 is the root; 5 is voted for. Its neighbours are 2 and 3 (2 is stronger), its children
/// 6 and 7, its parent 4.
struct Family {
  MapBuilder builder;
  std::vector<MapPointId> seen;
  Family() {
    builder.add_keyframes(8);
    seen = builder.add_points(1, kfs({5}));
    builder.add_points(30, kfs({5, 2}));
    builder.add_points(20, kfs({5, 3}));
    builder.map.update_connections(kf(5));
    builder.map.set_parent(kf(5), kf(4));
    builder.map.set_parent(kf(6), kf(5));
    builder.map.set_parent(kf(7), kf(5));
  }
  std::vector<KeyFrameId> local() {
    TrackedFrame frame = frame_seeing(builder.map, seen);
    return select_local_map(builder.map, frame).keyframes;
  }
};

// OD-71: adding a parent does not end the extension.
TEST(SelectLocalMap, OneNeighbourOneChildAndTheParentAreAdded) {
  Family family;
  EXPECT_EQ(family.local(), kfs({5, 2, 6, 4}));
}

TEST(SelectLocalMap, WhatIsListedAlreadyIsPassedOver) {
  Family family;
  family.seen.push_back(family.builder.add_point(kfs({2})));
  family.seen.push_back(family.builder.add_point(kfs({6})));
  family.seen.push_back(family.builder.add_point(kfs({4})));
  const auto local = family.local();
  // 2: its neighbour 5 is listed, so child 3 and parent 1; 4: all listed; 5: the neighbours are
  // listed, so child 7; 6: nothing new.
  EXPECT_EQ(local, kfs({2, 4, 5, 6, 3, 1, 7}));
}

// OD-72: only living ones are added.
TEST(SelectLocalMap, DeadRelativesAreSkipped) {
  Family family;
  family.builder.erase_keyframe(kf(2));
  family.builder.erase_keyframe(kf(6));
  EXPECT_EQ(family.local(), kfs({5, 3, 7, 4}));
}

TEST(SelectLocalMap, OnlyTheTenBestNeighboursAreTried) {
  MapBuilder builder;
  builder.add_keyframes(13);  // 12 is voted for; its neighbours 1..11 in this order
  std::vector<MapPointId> seen = builder.add_points(1, kfs({12}));
  for (int k = 1; k <= 11; ++k) builder.add_points(30 - k, {kf(12), kf(k)});
  builder.map.update_connections(kf(12));
  builder.map.set_parent(kf(12), kf(0));
  for (int k = 1; k <= 11; ++k) builder.map.set_parent(kf(k), kf(0));
  for (int k = 1; k <= 10; ++k) seen.push_back(builder.add_point({kf(k)}));
  TrackedFrame frame = frame_seeing(builder.map, seen);
  const auto local = select_local_map(builder.map, frame).keyframes;
  // 1..10 and 12 are voted for, 0 is their parent; the eleventh neighbour is never reached.
  EXPECT_EQ(std::count(local.begin(), local.end(), kf(11)), 0);
  EXPECT_EQ(local.size(), 12U);
}

TEST(SelectLocalMap, TheExtensionStopsBeyondEightyAndNeverCutsTheVotes) {
  MapBuilder builder;
  for (int k = 0; k < 300; ++k) builder.add_keyframe(true, 10);  // a chain by provisional parents
  std::vector<MapPointId> seen;
  const auto vote = [&](int n) {  // for every third keyframe: parent and child are new each time
    seen.clear();
    for (int i = 0; i < n; ++i) seen.push_back(builder.add_point({kf(2 + 3 * i)}));
    TrackedFrame frame = frame_seeing(builder.map, seen);
    return select_local_map(builder.map, frame).keyframes.size();
  };
  EXPECT_EQ(vote(20), 60U);
  EXPECT_EQ(vote(27), 81U);
  EXPECT_EQ(vote(28), 82U) << "80 is not more than 80: 28 + 2 * 26 = 80, one more adds its two";
  EXPECT_EQ(vote(79), 81U);
  EXPECT_EQ(vote(80), 82U);
  EXPECT_EQ(vote(81), 81U);
  EXPECT_EQ(vote(90), 90U);
}

// OD-76: replaced points of a frame are always exchanged.
TEST(RefreshAssociations, ExchangesReplacedPointsAndDropsTheDead) {
  MapBuilder builder;
  builder.add_keyframes(3);
  const auto points = builder.add_points(6, kfs({0, 1, 2}));
  TrackedFrame frame = frame_seeing(builder.map, {points[0], points[1], points[2], points[3]});
  frame.outlier[1] = 1;
  builder.map.set_position(points[0], {1, 2, 3});
  builder.map.replace_point(points[1], points[4]);
  builder.map.replace_point(points[4], points[5]);
  builder.map.set_position(points[5], {4, 5, 6});
  builder.map.erase_point(points[2]);
  builder.map.replace_point(points[3], points[0]);
  refresh_associations(builder.map, frame);
  EXPECT_EQ(frame.positions[0], Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(frame.map_points[1], points[5]);
  EXPECT_EQ(frame.positions[1], Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(frame.outlier[1], 1);
  EXPECT_FALSE(frame.map_points[2].valid());
  EXPECT_FALSE(frame.map_points[3].valid()) << "its successor is associated already";
}

TEST(GatherPoints, KeepsTheOrderAndLeavesOutTheDead) {
  MapBuilder builder;
  builder.add_keyframe();
  const auto points = builder.add_points(3, kfs({0}));
  builder.map.erase_point(points[1]);
  const PointBatch batch =
      gather_points(builder.map, {points[2], MapPointId(), points[1], points[0]});
  EXPECT_EQ(batch.ids, (std::vector<MapPointId>{points[2], points[0]}));
}

}  // namespace
}  // namespace orbslam::testing
