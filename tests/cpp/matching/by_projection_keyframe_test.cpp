// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/errors.hpp"
#include "matching/by_projection.hpp"
#include "matching/scenes.hpp"

namespace orbslam {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using namespace testing;

TEST(MatchKeyFrameByProjection, FindsThePointsOfAKeyFrame) {
  Scene scene(400, 5);
  const KeyFrameId keyframe = scene.add_keyframe(Pose());
  scene.observe_all(keyframe);
  const ProjectedFrame now = project_cloud(9, scene.cloud, Pose());
  TrackedFrame frame(now.frame);
  frame.T_cw = Pose();
  EXPECT_EQ(match_keyframe_by_projection(scene.map, keyframe, frame, {}, 10, 100),
            static_cast<int>(now.points.size()));
  for (std::size_t i = 0; i < now.points.size(); ++i) {
    EXPECT_EQ(frame.map_points[i], scene.points[now.points[i]]);
    EXPECT_EQ(frame.positions[i], scene.cloud.positions[now.points[i]]);
  }
}

// A keyframe with one point at 5 m, seen on level 0, and a frame with the given features.
struct KeyFrameScene {
  explicit KeyFrameScene(const std::vector<FeatureSpec>& features, std::int32_t level = 0)
      : frame(make_synthetic_frame(1, features)) {
    frame.T_cw = Pose();
    keyframe =
        map.add_keyframe(make_synthetic_frame(0, {feature(level), feature(7, 0, 100, 5)}), Pose());
    map.publish(keyframe);
    id = map.add_point({0, 0, 5}, keyframe, 0);
    map.add_observation(id, keyframe, 0);
    map.update_point(id);
  }
  int match(int max_distance = 100, const std::vector<MapPointId>& found = {}) {
    return match_keyframe_by_projection(map, keyframe, frame, found, 10, max_distance);
  }

  Map map;
  KeyFrameId keyframe;
  MapPointId id;
  TrackedFrame frame;
};

TEST(MatchKeyFrameByProjection, NeighbouringLevelsOfThePredictedOne) {
  for (int level = 0; level < 8; ++level) {
    KeyFrameScene scene({feature(level)}, 4);
    EXPECT_EQ(scene.match(), level >= 3 && level <= 5 ? 1 : 0) << level;
  }
}

TEST(MatchKeyFrameByProjection, DescriptorLimitIsTheCallers) {
  EXPECT_EQ(KeyFrameScene({feature(0, 64)}).match(64), 1);
  EXPECT_EQ(KeyFrameScene({feature(0, 65)}).match(64), 0);
  EXPECT_EQ(KeyFrameScene({feature(0, 100)}).match(100), 1);
}

TEST(MatchKeyFrameByProjection, FoundPointsAndHeldKeypointsStay) {
  KeyFrameScene found({feature(0)});
  EXPECT_EQ(found.match(100, {found.id}), 0);
  for (const MapPointId held : {MapPointId(77), kFirstTemporaryPoint}) {
    KeyFrameScene scene({feature(0)});
    scene.frame.associate(0, held, {0, 0, 1});
    EXPECT_EQ(scene.match(), 0);
    EXPECT_EQ(scene.frame.map_points[0], held);
  }
}

// OD-84: points behind the camera are skipped.
TEST(MatchKeyFrameByProjection, PointsBehindAreNotMirroredIntoTheImage) {
  KeyFrameScene scene({feature(0)});
  scene.map.set_position(scene.id, {0, 0, -5});
  EXPECT_EQ(scene.match(), 0);
}

TEST(MatchKeyFrameByProjection, DistanceLimitsHoldButNotTheViewingAngle) {
  // From behind the wall: 180 degrees away from where it was mapped.
  KeyFrameScene turned({feature(0)});
  turned.frame.T_cw =
      Pose(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitY()).toRotationMatrix(), {0, 0, 10});
  EXPECT_EQ(turned.match(), 1);
  KeyFrameScene far({feature(0)});
  far.frame.T_cw = Pose(Eigen::Quaterniond::Identity(), {0, 0, 1.1});  // 6.1 m > 1.2 * 5 m
  EXPECT_EQ(far.match(), 0);
}

TEST(MatchKeyFrameByProjection, DeadPointsAndKeyFramesMatchNothing) {
  KeyFrameScene point_dies({feature(0)});
  point_dies.map.erase_point(point_dies.id);
  EXPECT_EQ(point_dies.match(), 0);
  KeyFrameScene scene({feature(0)});
  EXPECT_EQ(match_keyframe_by_projection(scene.map, KeyFrameId(5), scene.frame, {}, 10, 100), 0);
}

TEST(MatchKeyFrameByProjection, RotationMustAgreeWithTheMajority) {
  Scene scene(200, 6);
  const KeyFrameId keyframe = scene.add_keyframe(Pose());
  scene.observe_all(keyframe);
  const ProjectedFrame now = project_cloud(9, scene.cloud, Pose());
  now.frame->keypoints[3].angle = 77;
  TrackedFrame frame(now.frame);
  frame.T_cw = Pose();
  EXPECT_EQ(match_keyframe_by_projection(scene.map, keyframe, frame, {}, 10, 100),
            static_cast<int>(now.points.size()) - 1);
  EXPECT_FALSE(frame.map_points[3].valid());
}

TEST(MatchKeyFrameByProjection, WrongArguments) {
  KeyFrameScene scene({feature(0)});
  EXPECT_THROW(scene.match(100, {MapPointId(3), MapPointId(1)}), StateError);
  scene.frame.T_cw.reset();
  EXPECT_THROW(scene.match(), StateError);
}

}  // namespace
}  // namespace orbslam
