// SPDX-License-Identifier: BSD-3-Clause
#include "map/map_rewrite.hpp"

#include <gtest/gtest.h>

#include "map_builder.hpp"

namespace orbslam::testing {
namespace {

const Pose kMoved(Eigen::Quaterniond(0.9, 0.1, 0, 0.2), Eigen::Vector3d(0.3, 0.1, -0.2));

class Rewrite : public ::testing::Test {
 protected:
  void SetUp() override {
    builder.add_keyframes(5);  // more than the least that keeps a point alive
    point = builder.map.add_point({0, 0, 2}, kf(0), 0);
    for (int k = 0; k < 5; ++k) builder.map.add_observation(point, kf(k), 50);
    builder.map.update_point(point);
    rewrite.move_keyframe(kf(1), kMoved, 1.25);
    rewrite.move_point(point, {0.5, 0.25, 4});
  }
  /// What the map works out itself once everything is in place.
  void expect_consistent() {
    const MapPoint written = *builder.map.find(point);
    EXPECT_EQ(written.position, Eigen::Vector3d(0.5, 0.25, 4));
    builder.map.update_geometry(point);
    const MapPoint& expected = *builder.map.find(point);
    EXPECT_EQ(written.mean_direction, expected.mean_direction);
    EXPECT_EQ(written.min_distance, expected.min_distance);
    EXPECT_EQ(written.max_distance, expected.max_distance);
  }
  MapBuilder builder;
  MapPointId point;
  MapRewrite rewrite;
};

TEST_F(Rewrite, WritesPosesScalesPositionsAndWhatFollows) {
  rewrite.prepare(builder.map);
  rewrite.apply(builder.map);
  EXPECT_TRUE(builder.map.T_cw(kf(1)).matrix().isApprox(kMoved.matrix(), 1e-15));
  EXPECT_EQ(builder.map.scaled_pose(kf(1)).scale, 1.25);
  EXPECT_EQ(builder.map.scaled_pose(kf(0)).scale, 1.0);
  expect_consistent();
}

TEST_F(Rewrite, WorksOutWhatHasChangedSinceItWasPrepared) {
  rewrite.prepare(builder.map);
  builder.map.erase_observation(point, kf(2));
  rewrite.apply(builder.map);
  expect_consistent();
}

TEST_F(Rewrite, AnUnpreparedOneIsTheSame) {
  rewrite.apply(builder.map);
  expect_consistent();
}

TEST_F(Rewrite, LeavesOutWhatHasDied) {
  rewrite.prepare(builder.map);
  builder.map.erase_point(point);
  ASSERT_TRUE(builder.erase_keyframe(kf(1)));
  rewrite.apply(builder.map);
  EXPECT_EQ(builder.map.find(point), nullptr);
  EXPECT_EQ(builder.map.find(kf(1)), nullptr);
}

TEST_F(Rewrite, TheLastMoveOfAKeyframeCounts) {
  rewrite.move_keyframe(kf(1), Pose());
  EXPECT_EQ(rewrite.n_keyframes(), 1U);
  EXPECT_EQ(rewrite.T_cw(kf(2)), nullptr);
  rewrite.apply(builder.map);
  EXPECT_TRUE(builder.map.T_cw(kf(1)).matrix().isIdentity());
}

}  // namespace
}  // namespace orbslam::testing
