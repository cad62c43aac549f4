// SPDX-License-Identifier: BSD-3-Clause
#include "map/anchor.hpp"

#include <gtest/gtest.h>

#include "base/errors.hpp"
#include "map/keyframe_insertion.hpp"
#include "map/local_map.hpp"
#include "map_builder.hpp"

namespace orbslam::testing {
namespace {

const Pose kStep(Eigen::Quaterniond(0.9, 0.1, 0.2, 0.3), Eigen::Vector3d(0.1, 0.2, 0.3));
const Pose kMove(Eigen::Quaterniond(0.8, 0.3, 0.1, 0.2), Eigen::Vector3d(1, -2, 3));

/// All keyframes by the same rigid motion and scale of the world, as a loop would.
void move_world(Map& map, double scale) {
  for (const KeyFrameId id : map.keyframe_ids()) {
    const Pose moved = map.T_cw(id) * kMove;
    map.set_pose(id, Pose(moved.rotation(), scale * moved.translation()));
    map.rescale(id, scale);
  }
  map.count_big_change();
}

class AnchoredFrame : public ::testing::Test {
 protected:
  void SetUp() override {
    builder.add_keyframes(3);
    frame.T_cw = kStep * builder.map.T_cw(kf(1));
    anchor_frame(builder.map, frame, kf(1));
  }
  Pose expected(double scale) const {
    return Pose(kStep.rotation(), scale * kStep.translation()) * builder.map.T_cw(kf(1));
  }
  MapBuilder builder;
  TrackedFrame frame{make_raster_frame(7, 4)};
};

TEST_F(AnchoredFrame, StaysWhereItWasInAMapThatDoesNotMove) {
  const FollowedMap followed = follow_map(builder.map, frame);
  EXPECT_EQ(followed.stretched, 1.0);
  EXPECT_TRUE(frame.T_cw->matrix().isApprox(expected(1).matrix(), 1e-12));
}

TEST_F(AnchoredFrame, FollowsItsKeyframeAndTheScale) {
  move_world(builder.map, 1.5);
  EXPECT_DOUBLE_EQ(follow_map(builder.map, frame).stretched, 1.5);
  EXPECT_TRUE(frame.T_cw->matrix().isApprox(expected(1.5).matrix(), 1e-12));
  EXPECT_EQ(frame.anchor.big_change, builder.map.big_change_index());
  EXPECT_EQ(follow_map(builder.map, frame).stretched, 1.0);
}

TEST_F(AnchoredFrame, TellsHowItMovedUnlessALoopDidIt) {
  const Pose before = *frame.T_cw;
  const Pose adjusted = builder.map.T_cw(kf(1)) * kMove;
  builder.map.set_pose(kf(1), adjusted);  // as local bundle adjustment does
  const auto moved = follow_map(builder.map, frame).moved;
  ASSERT_TRUE(moved);
  EXPECT_TRUE((*moved * before).matrix().isApprox((kStep * adjusted).matrix(), 1e-12));
  move_world(builder.map, 1.5);
  EXPECT_FALSE(follow_map(builder.map, frame).moved);
  frame.T_cw.reset();
  EXPECT_FALSE(follow_map(builder.map, frame).moved);
}

TEST_F(AnchoredFrame, BecomesAKeyframeOfTheMapAsItIs) {
  move_world(builder.map, 1);
  const KeyFrameId id = insert_keyframe(builder.map, frame, false);
  EXPECT_TRUE(builder.map.T_cw(id).matrix().isApprox(expected(1).matrix(), 1e-12));
  EXPECT_EQ(frame.reference_keyframe(), id);
}

TEST_F(AnchoredFrame, IsCarriedAlongWhenTheLocalMapIsChosenAfterTheMapMoved) {
  move_world(builder.map, 1);
  select_local_map(builder.map, frame);
  EXPECT_TRUE(frame.T_cw->matrix().isApprox(expected(1).matrix(), 1e-12));
  EXPECT_EQ(frame.reference_keyframe(), kf(1));  // nobody voted for another one
}

TEST_F(AnchoredFrame, FollowsACulledKeyframeThroughItsParent) {
  ASSERT_TRUE(builder.erase_keyframe(kf(1)));
  EXPECT_EQ(builder.map.living(kf(1)), kf(0));
  move_world(builder.map, 1);
  const Pose T_1w = builder.map.T_cw(kf(1));
  follow_map(builder.map, frame);
  EXPECT_TRUE(frame.T_cw->matrix().isApprox((kStep * T_1w).matrix(), 1e-12));
}

TEST_F(AnchoredFrame, PointsGiveWayToTheirSuccessors) {
  const MapPointId a = builder.map.add_point({0, 0, 2}, kf(0), 0);
  const MapPointId b = builder.map.add_point({0, 0, 3}, kf(0), 0);
  const MapPointId dead = builder.map.add_point({0, 0, 4}, kf(0), 0);
  builder.map.add_observation(a, kf(0), 0);
  builder.map.add_observation(b, kf(1), 0);
  frame.associate(0, a, {0, 0, 2});
  frame.associate(1, dead, {0, 0, 4});
  builder.map.replace_point(a, b);
  builder.map.erase_point(dead);
  const FollowedMap followed = follow_map(builder.map, frame);
  EXPECT_EQ(followed.points.ids, (std::vector<MapPointId>{b}));
  EXPECT_EQ(frame.map_points[0], b);
  EXPECT_FALSE(frame.map_points[1].valid());
}

TEST(Anchor, NeedsAKnownKeyframe) {
  MapBuilder builder;
  builder.add_keyframes(1);
  TrackedFrame frame(make_raster_frame(1, 1));
  EXPECT_THROW(anchor_frame(builder.map, frame, kf(5)), StateError);
  EXPECT_EQ(follow_map(builder.map, frame).stretched, 1.0);  // without a pose nothing to do
  EXPECT_FALSE(builder.map.living(kf(5)).valid());
}

}  // namespace
}  // namespace orbslam::testing
