// SPDX-License-Identifier: BSD-3-Clause
// Several maps in one store.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/errors.hpp"
#include "map/anchor.hpp"
#include "map/map_builder.hpp"
#include "map/snapshot.hpp"
#include "map/trajectory.hpp"

namespace orbslam {
namespace {

using namespace testing;
using ::testing::ElementsAre;

/// Keyframes 0 to 3 in map 0, 4 to 6 in map 1, tied by points.
struct TwoMaps : MapBuilder {
  TwoMaps() {
    add_keyframes(4);
    add_points(20, kfs({0, 1, 2, 3}));
    map.begin_map();
    add_keyframes(3);
    add_points(30, kfs({4, 5, 6}));
    for (int k = 0; k < 7; ++k) map.update_connections(kf(k));
  }
};

TEST(SeveralMaps, OneMapIsThereFromTheBeginning) {
  MapBuilder builder;
  EXPECT_EQ(builder.map.active_map(), 0);
  EXPECT_TRUE(builder.map.maps().empty());
  EXPECT_EQ(builder.map.begin_map(), 0);  // nothing to put beside it
  builder.add_keyframe();
  EXPECT_THAT(builder.map.maps(), ElementsAre(0));
  EXPECT_EQ(builder.map.root(0), kf(0));
}

TEST(SeveralMaps, KeyframesBelongToTheActiveOne) {
  TwoMaps two;
  EXPECT_EQ(two.violations(), "");
  EXPECT_THAT(two.map.maps(), ElementsAre(0, 1));
  EXPECT_EQ(two.map.active_map(), 1);
  EXPECT_EQ(two.map.root(1), kf(4));
  EXPECT_EQ(two.map.map_of(kf(3)), 0);
  EXPECT_EQ(two.map.map_of(kf(6)), 1);
  EXPECT_EQ(two.map.map_of(MapPointId(25)), 1);
  EXPECT_EQ(two.map.n_keyframes_of(0), 4U);
  EXPECT_EQ(two.map.n_keyframes(), 7U);
  EXPECT_FALSE(two.map.find(kf(4))->parent.valid());
  // Roots never die.
  EXPECT_FALSE(two.map.erase_keyframe(kf(4)));
  EXPECT_THROW(two.map.set_parent(kf(4), kf(5)), StateError);

  two.map.activate_map(0);
  const KeyFrameId next = two.add_keyframe();
  EXPECT_EQ(two.map.map_of(next), 0);
  // It hangs in its own map, although one of the other is younger.
  EXPECT_EQ(two.map.find(next)->parent, kf(3));
  EXPECT_THROW(two.map.activate_map(5), StateError);
  EXPECT_EQ(two.violations(), "");
}

TEST(SeveralMaps, SnapshotsAndTrajectoriesAreOfOneMap) {
  TwoMaps two;
  EXPECT_THAT(snapshot_keyframes(two.map).ids, ElementsAre(kf(4), kf(5), kf(6)));
  EXPECT_EQ(snapshot_keyframes(two.map, 0).ids.size(), 4U);
  EXPECT_EQ(snapshot_map(two.map, 0).points.ids.size(), 20U);
  EXPECT_EQ(snapshot_map(two.map, 1).points.ids.size(), 30U);
  EXPECT_EQ(snapshot_observations(two.map, 0).ids.size(), 20U);

  TrajectoryRecorder recorder;
  for (const int k : {1, 5, 2}) {
    TrackedFrame frame(make_raster_frame(10 * (k == 2 ? 9 : k), 10));
    frame.T_cw = two.map.T_cw(kf(k));
    anchor_frame(two.map, frame, kf(k));
    recorder.record(two.map, frame, false);
  }
  EXPECT_THAT(recorder.rebuild(two.map, 0).frames, ElementsAre(10, 90));
  EXPECT_THAT(recorder.rebuild(two.map, 1).frames, ElementsAre(50));
  // Relative to the root of the map: keyframe 5 stands a metre beside keyframe 4.
  EXPECT_NEAR(recorder.rebuild(two.map, 1).T_wc[0][3], 1, 1e-12);
  recorder.drop(two.map, 1);
  EXPECT_EQ(recorder.size(), 2U);
}

TEST(SeveralMaps, AFrameIsRecordedAnewWhereItWas) {
  TwoMaps two;
  TrajectoryRecorder recorder;
  for (const FrameId id : {7, 8, 9}) {
    TrackedFrame lost(make_raster_frame(id, 10));
    if (id == 7) {
      lost.T_cw = Pose();
      anchor_frame(two.map, lost, kf(0));
    }
    recorder.record(two.map, lost, id != 7);
  }
  TrackedFrame found(make_raster_frame(8, 10));
  found.T_cw = Pose();
  anchor_frame(two.map, found, kf(5));
  recorder.record(two.map, found, false);
  EXPECT_THAT(recorder.rebuild(two.map, 0).frames, ElementsAre(7, 9));
  EXPECT_THAT(recorder.rebuild(two.map, 0).lost, ElementsAre(0, 1));
  EXPECT_THAT(recorder.rebuild(two.map, 1).lost, ElementsAre(0));
}

TEST(SeveralMaps, ADroppedOneIsGoneWithAllOfIt) {
  TwoMaps two;
  EXPECT_TRUE(two.erase_keyframe(kf(5)));
  EXPECT_EQ(two.map.map_of(kf(5)), 1);  // culled, and remembered
  EXPECT_THAT(two.map.erase_map(1), ElementsAre(kf(4), kf(6)));
  EXPECT_EQ(two.violations(), "");
  EXPECT_EQ(two.map.active_map(), 0);
  EXPECT_EQ(two.map.map_of(kf(5)), kNoMap);
  EXPECT_EQ(two.map.n_points(), 20U);
  EXPECT_EQ(two.map.n_keyframes(), 4U);
  EXPECT_EQ(two.map.begin_map(), 2);  // numbers are not used twice
}

TEST(SeveralMaps, JoinedTheyHaveOneTree) {
  TwoMaps two;
  two.map.join_maps(kf(6), kf(2));
  EXPECT_EQ(two.violations(), "");
  EXPECT_THAT(two.map.maps(), ElementsAre(0));
  EXPECT_EQ(two.map.active_map(), 0);
  EXPECT_EQ(two.map.find(kf(6))->parent, kf(2));
  EXPECT_EQ(two.map.n_keyframes_of(0), 7U);
  EXPECT_TRUE(two.map.find(kf(4))->parent.valid());
  EXPECT_THROW(two.map.join_maps(kf(6), kf(2)), StateError);
}

TEST(SeveralMaps, ClearingBeginsTheNextOne) {
  TwoMaps two;
  two.map.clear();
  EXPECT_EQ(two.map.active_map(), 2);
  EXPECT_TRUE(two.map.maps().empty());
}

}  // namespace
}  // namespace orbslam
