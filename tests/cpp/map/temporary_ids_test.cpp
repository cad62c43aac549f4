// SPDX-License-Identifier: BSD-3-Clause
// What the verbs of the map make of frames that hold temporary points.
#include <gtest/gtest.h>

#include "map/keyframe_insertion.hpp"
#include "map/local_map.hpp"
#include "map/point_batch.hpp"
#include "map/sightings.hpp"
#include "map_builder.hpp"

namespace orbslam::testing {
namespace {

const MapPointId kTemporary(kFirstTemporaryPoint.value + 7);

/// Three keyframes that share 30 points; the frame holds the first ten and a temporary one.
struct Setting {
  MapBuilder builder;
  std::vector<MapPointId> points;
  TrackedFrame frame{make_raster_frame(9, 40, 3)};

  Setting() {
    builder.add_keyframes(3);
    points = builder.add_points(30, {KeyFrameId(0), KeyFrameId(1), KeyFrameId(2)});
    frame.T_cw = Pose();
    for (std::size_t i = 0; i < 10; ++i) frame.associate(i, points[i], {0, 0, 5});
    frame.associate(20, kTemporary, {1, 2, 3});
  }
};

TEST(TemporaryIds, MapsDoNotFindThem) {
  Setting s;
  EXPECT_EQ(s.builder.map.find(kTemporary), nullptr);
  EXPECT_EQ(s.builder.map.find(MapPointId(INT64_MAX)), nullptr);
  EXPECT_FALSE(s.builder.map.resolve(kTemporary).valid());
  EXPECT_EQ(gather_points(s.builder.map, s.frame.map_points).ids,
            std::vector<MapPointId>(s.points.begin(), s.points.begin() + 10));
}

TEST(TemporaryIds, StayAssociatedWhileTheLocalMapIsChosen) {
  Setting s;
  s.builder.map.erase_point(s.points[3]);
  refresh_associations(s.builder.map, s.frame);
  const LocalMap local = select_local_map(s.builder.map, s.frame);
  EXPECT_FALSE(s.frame.map_points[3].valid());
  EXPECT_EQ(s.frame.map_points[20], kTemporary);
  EXPECT_EQ(s.frame.positions[20], Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(local.keyframes.size(), 3U);
  EXPECT_EQ(local.points.size(), 29U);
}

TEST(TemporaryIds, AloneTheyVoteForNothing) {
  Setting s;
  s.frame.clear_associations();
  s.frame.associate(20, kTemporary, {1, 2, 3});
  const LocalMap local = select_local_map(s.builder.map, s.frame);
  EXPECT_TRUE(local.keyframes.empty());
  EXPECT_FALSE(local.reference_keyframe.valid());
  EXPECT_EQ(s.frame.map_points[20], kTemporary);
}

TEST(TemporaryIds, SightingsOfThemAreNotCounted) {
  Setting s;
  count_sightings(s.builder.map, s.frame, {s.points[12], kTemporary});
  EXPECT_EQ(s.builder.map.find(s.points[0])->n_found.value(), 2);
  EXPECT_EQ(s.builder.map.find(s.points[12])->n_visible.value(), 2);
  EXPECT_EQ(s.builder.map.find(s.points[13])->n_visible.value(), 1);
}

TEST(TemporaryIds, OutlierIsDiscarded) {
  Setting s;
  s.frame.outlier[20] = 1;
  s.frame.outlier[4] = 1;
  EXPECT_EQ(s.frame.discard_outliers(), (std::vector<MapPointId>{s.points[4], kTemporary}));
  EXPECT_FALSE(s.frame.map_points[20].valid());
}

TEST(TemporaryIds, KeyframesDoNotHoldThem) {
  Setting s;
  const KeyFrameId bare = insert_keyframe(s.builder.map, s.frame, false);
  EXPECT_FALSE(s.builder.map.find(bare)->map_points[20].valid());
  EXPECT_FALSE(s.frame.map_points[20].valid());

  Setting t;  // with depths the keypoint gets a point of the map instead
  const KeyFrameId id = insert_keyframe(t.builder.map, t.frame, true);
  const MapPointId made = t.builder.map.find(id)->map_points[20];
  ASSERT_NE(t.builder.map.find(made), nullptr);
  EXPECT_EQ(t.frame.map_points[20], made);
  EXPECT_TRUE(check_invariants(t.builder.map, false).empty());
}

}  // namespace
}  // namespace orbslam::testing
