// SPDX-License-Identifier: BSD-3-Clause
#include "map/map.hpp"

#include <gtest/gtest.h>

#include "base/errors.hpp"
#include "map_builder.hpp"

namespace orbslam::testing {
namespace {

TEST(IdTable, FindsErasesAndVisitsInOrder) {
  IdTable<KeyFrameId, int> table;
  for (const std::int64_t id : {600, 3, 255, 256}) {
    table.insert(kf(id), std::make_unique<int>(static_cast<int>(id)));
  }
  EXPECT_EQ(table.size(), 4U);
  EXPECT_EQ(*table.find(kf(256)), 256);
  EXPECT_EQ(table.find(kf(257)), nullptr);
  EXPECT_EQ(table.find(kf(100000)), nullptr);
  EXPECT_EQ(table.find(KeyFrameId()), nullptr);
  table.erase(kf(255));
  table.erase(kf(255));
  std::vector<int> visited;
  table.for_each([&](const int& value) { visited.push_back(value); });
  EXPECT_EQ(visited, (std::vector<int>{3, 256, 600}));
}

// OD-57: a dead keyframe does not keep its frame.
TEST(Map, DeadObjectsAreFreed) {
  MapBuilder builder;
  builder.add_keyframes(2);
  std::weak_ptr<const Frame> frame = builder.map.find(kf(1))->frame;
  builder.erase_keyframe(kf(1));
  EXPECT_TRUE(frame.expired());
  frame = builder.map.find(kf(0))->frame;
  builder.map.clear();
  EXPECT_TRUE(frame.expired());
}

TEST(Map, PublishingCountsAKeyframeOnce) {
  MapBuilder builder;
  const KeyFrameId id = builder.add_keyframe(false);
  EXPECT_EQ(builder.map.n_keyframes(), 0U);
  EXPECT_EQ(builder.map.keyframe_ids(), kfs({0}));
  builder.map.publish(id);
  builder.map.publish(id);
  EXPECT_EQ(builder.map.n_keyframes(), 1U);
}

TEST(Map, ClearingStartsANewEpoch) {
  MapBuilder builder;
  builder.add_keyframes(3);
  builder.add_points(5, kfs({0, 1, 2}));
  builder.map.count_big_change();
  builder.erase_keyframe(kf(2));
  const auto structure = builder.map.structure_version();
  builder.map.clear();
  EXPECT_EQ(builder.map.epoch(), 1U);
  EXPECT_EQ(builder.map.big_change_index(), 0U);
  EXPECT_GT(builder.map.structure_version(), structure);
  EXPECT_EQ(builder.map.n_keyframes(), 0U);
  EXPECT_EQ(builder.map.n_points(), 0U);
  EXPECT_THROW(builder.map.T_cw(kf(2)), StateError) << "the archive is dropped, too";
  EXPECT_EQ(builder.map.add_keyframe(make_raster_frame(0, 1), Pose()), kf(0));
  EXPECT_EQ(builder.map.add_point({0, 0, 1}, kf(0), 0), MapPointId(0));
}

TEST(Map, VersionsTellWhatChanged) {
  MapBuilder builder;
  builder.add_keyframes(2);
  const MapPointId id = builder.add_point(kfs({0, 1}));
  auto structure = builder.map.structure_version();
  auto geometry = builder.map.geometry_version();
  builder.map.set_pose(kf(1), Pose());
  EXPECT_GT(builder.map.geometry_version(), geometry);
  geometry = builder.map.geometry_version();
  builder.map.set_position(id, {1, 2, 3});
  EXPECT_GT(builder.map.geometry_version(), geometry);
  EXPECT_EQ(builder.map.structure_version(), structure);
  builder.map.erase_observation(id, kf(1));
  EXPECT_GT(builder.map.structure_version(), structure);
}

TEST(Map, SlotsWithoutObservationAreForUnpublishedKeyframes) {
  MapBuilder builder;
  builder.add_keyframes(2);
  const MapPointId id = builder.add_point(kfs({0, 1}));
  const KeyFrameId waiting = builder.add_keyframe(false);
  builder.map.set_slot(waiting, 2, id);
  EXPECT_EQ(builder.map.find(waiting)->map_points[2], id);
  EXPECT_EQ(builder.map.find(id)->observation_count, 2);
  EXPECT_EQ(builder.violations(), "");
  EXPECT_THROW(builder.map.set_slot(kf(0), 5, id), StateError);
  builder.map.add_observation(id, waiting, 2);
  EXPECT_THROW(builder.map.set_slot(waiting, 2, MapPointId()), StateError);
  EXPECT_EQ(builder.violations(), "");
}

TEST(Invariants, AreViolatedByAPublishedSlotWithoutObservation) {
  MapBuilder builder;
  builder.add_keyframes(2);
  const MapPointId id = builder.add_point(kfs({0, 1}));
  const KeyFrameId waiting = builder.add_keyframe(false);
  builder.map.set_slot(waiting, 2, id);
  builder.map.publish(waiting);
  EXPECT_EQ(builder.violations(), "keyframe 2 holds point 0 in slot 2 without being observed\n");
}

TEST(Invariants, AreViolatedByAPointWithoutObservations) {
  MapBuilder builder;
  builder.add_keyframe();
  builder.map.add_point({0, 0, 1}, kf(0), 0);
  EXPECT_EQ(check_invariants(builder.map, false).size(), 2U);  // no count, no reference
}

TEST(Invariants, AskForWordsOnDemand) {
  MapBuilder builder;
  builder.add_keyframe();
  EXPECT_EQ(check_invariants(builder.map, true).size(), 1U);
  builder.map.clear();
  const auto frame = make_raster_frame(0, 1);
  frame->described = true;
  builder.map.add_keyframe(frame, Pose());
  EXPECT_TRUE(check_invariants(builder.map, true).empty());
}

}  // namespace
}  // namespace orbslam::testing
