// SPDX-License-Identifier: BSD-3-Clause
#include "map/changed_ids.hpp"

#include <gtest/gtest.h>

#include "map_builder.hpp"

namespace orbslam::testing {
namespace {

using PointIds = std::vector<MapPointId>;

struct Marked : MapBuilder {
  Marked() {
    add_keyframes(4);
    add_points(5, kfs({2, 3}));
  }
};

TEST(ChangedIds, AreThoseSinceAMoment) {
  Marked marked;
  Map& map = marked.map;
  const MapStamp before = stamp_of(map);
  ChangedIds changed = changed_since(map, before);
  EXPECT_TRUE(changed.keyframes.empty() && changed.keyframes_removed.empty());
  EXPECT_TRUE(changed.points.empty() && changed.points_removed.empty());
  EXPECT_FALSE(changed.restarted);
  EXPECT_EQ(changed.stamp, before);

  map.set_position(MapPointId(4), {1, 1, 1});
  map.erase_point(MapPointId(2));
  marked.add_keyframe(false);
  EXPECT_TRUE(marked.erase_keyframe(kf(1)));
  changed = changed_since(map, before);
  EXPECT_EQ(changed.points, (PointIds{MapPointId(4)}));
  EXPECT_EQ(changed.points_removed, (PointIds{MapPointId(2)}));
  EXPECT_EQ(changed.keyframes, kfs({2, 4})) << "the parent of keyframe 2 was another";
  EXPECT_EQ(changed.keyframes_removed, kfs({1}));

  const MapStamp after = stamp_of(map);
  EXPECT_EQ(changed.stamp, after);
  EXPECT_FALSE(after == before);
  map.set_pose(kf(3), Pose());
  changed = changed_since(map, after);
  EXPECT_EQ(changed.keyframes, kfs({3}));
  EXPECT_TRUE(changed.points.empty());
}

TEST(ChangedIds, OfTheBeginningAreAllThatLive) {
  Marked marked;
  marked.map.erase_point(MapPointId(2));
  const ChangedIds changed = changed_since(marked.map, MapStamp());
  EXPECT_EQ(changed.keyframes, kfs({0, 1, 2, 3}));
  EXPECT_EQ(changed.points, marked.map.point_ids());
  EXPECT_EQ(changed.points_removed, PointIds{MapPointId(2)});
}

TEST(ChangedIds, SightingsAreNoChanges) {
  Marked marked;
  const MapStamp before = stamp_of(marked.map);
  marked.map.count_visible(MapPointId(1));
  marked.map.count_found(MapPointId(1));
  EXPECT_EQ(stamp_of(marked.map), before);
}

TEST(ChangedIds, OfAnEarlierMapAreAllOfThePresentOne) {
  Marked marked;
  const MapStamp before = stamp_of(marked.map);
  marked.map.clear();
  marked.map.add_keyframe(make_raster_frame(0, 4), Pose());
  const ChangedIds changed = changed_since(marked.map, before);
  EXPECT_TRUE(changed.restarted);
  EXPECT_EQ(changed.keyframes, kfs({0}));
  EXPECT_EQ(changed.stamp.epoch, 1U);
}

}  // namespace
}  // namespace orbslam::testing
