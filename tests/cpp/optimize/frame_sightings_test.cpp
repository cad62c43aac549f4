// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/frame_sightings.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <random>
#include <vector>

#include "map/anchor.hpp"
#include "optimize/pose_optimization.hpp"
#include "support/synthetic_frames.hpp"

namespace orbslam {
namespace {

using testing::make_point_cloud;
using testing::PointCloud;
using testing::project_cloud;
using testing::ProjectedFrame;
using testing::ProjectionOptions;

/// A keyframe at the origin that sees a cloud of points, each some centimetres from where it is,
/// and a frame beside it whose pose fits these.
class Tracked {
 public:
  Map map;
  TrajectoryRecorder recorder;
  FrameSightings sightings;
  PointCloud cloud = make_point_cloud(200, 2, 4, 9, 1);
  std::vector<MapPointId> points;
  Pose truth{Eigen::Quaterniond::Identity(), Eigen::Vector3d(-0.3, 0.1, 0)};

  explicit Tracked(bool with_depth = true) {
    ProjectionOptions options;
    options.with_depth = with_depth;
    camera_ = testing::synthetic_camera(with_depth ? 40 : 0);
    const ProjectedFrame seen = project_cloud(0, cloud, Pose(), options, camera_);
    keyframe = map.add_keyframe(seen.frame, Pose());
    std::mt19937_64 random(3);
    for (const Eigen::Vector3d& position : cloud.positions) {
      const Eigen::Vector3d wrong(0.05 + testing::uniform(random, -0.02, 0.02), 0,
                                  testing::uniform(random, -0.02, 0.02));
      points.push_back(map.add_point(position + wrong, keyframe, 0));
    }
    for (std::size_t i = 0; i < seen.points.size(); ++i) {
      map.add_observation(points[seen.points[i]], keyframe, i);
    }
    map.publish(keyframe);
  }

  KeyFrameId keyframe;

  TrackedFrame track(FrameId id) {
    ProjectionOptions options;
    options.with_depth = camera_->bf() > 0;
    const ProjectedFrame seen = project_cloud(id, cloud, truth, options, camera_);
    TrackedFrame frame(seen.frame);
    frame.T_cw = truth;
    for (std::size_t i = 0; i < seen.points.size(); ++i) {
      const MapPointId point = points[seen.points[i]];
      frame.associate(i, point, map.find(point)->position);
    }
    optimize_pose(frame);
    anchor_frame(map, frame, keyframe);
    return frame;
  }
  void record(const TrackedFrame& frame, bool lost = false) {
    recorder.record(map, frame, lost);
    sightings.keep(frame);
  }
  void put_points_right() {
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (map.find(points[i]) != nullptr) map.set_position(points[i], cloud.positions[i]);
    }
  }
  double error(FrameId frame) const {
    const auto lock = map.read_lock();
    return (recorder.T_cw(map, frame)->center() - truth.center()).norm();
  }

 private:
  std::shared_ptr<const Camera> camera_;
};

TEST(FrameSightings, AFrameFollowsThePointsThatItSaw) {
  for (const bool with_depth : {true, false}) {
    Tracked tracked(with_depth);
    tracked.record(tracked.track(1));
    EXPECT_GT(tracked.error(1), 0.02);
    tracked.put_points_right();
    EXPECT_EQ(tracked.sightings.settle(tracked.map, tracked.recorder, 0), 1);
    EXPECT_LT(tracked.error(1), 1e-3);
    EXPECT_EQ(tracked.sightings.size(), 0U);
    // It goes on following its keyframe.
    const Pose T_21(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, 1));
    tracked.map.set_pose(tracked.keyframe, T_21);
    const auto lock = tracked.map.read_lock();
    EXPECT_NEAR((tracked.recorder.T_cw(tracked.map, 1)->translation() -
                 (tracked.truth * T_21).translation())
                    .norm(),
                0, 1e-3);
  }
}

TEST(FrameSightings, TheYoungestWaitAndTheOldestAreSettledFirst) {
  Tracked tracked;
  for (FrameId id = 1; id <= 5; ++id) tracked.record(tracked.track(id));
  tracked.put_points_right();
  EXPECT_EQ(tracked.sightings.settle(tracked.map, tracked.recorder, 3), 2);
  EXPECT_EQ(tracked.sightings.size(), 3U);
  EXPECT_LT(tracked.error(2), 1e-3);
  EXPECT_GT(tracked.error(3), 0.02);
  EXPECT_EQ(tracked.sightings.settle(tracked.map, tracked.recorder, 3), 0);
}

TEST(FrameSightings, ReplacedPointsGiveWayAndDeadOnesAreLeftOut) {
  Tracked tracked;
  tracked.record(tracked.track(1));
  tracked.put_points_right();
  for (std::size_t i = 0; i < 40; ++i) tracked.map.erase_point(tracked.points[i]);
  const MapPointId instead =
      tracked.map.add_point(tracked.cloud.positions[50], tracked.keyframe, 0);
  tracked.map.replace_point(tracked.points[50], instead);
  EXPECT_EQ(tracked.sightings.settle(tracked.map, tracked.recorder, 0), 1);
  EXPECT_LT(tracked.error(1), 1e-3);
}

TEST(FrameSightings, FramesOfLivingKeyframesLostOnesAndThoseThatNoLongerAgreeStay) {
  Tracked tracked;
  TrackedFrame frame = tracked.track(1);
  const KeyFrameId made = tracked.map.add_keyframe(frame.frame, *frame.T_cw);
  tracked.map.publish(made);
  anchor_frame(tracked.map, frame, made);
  tracked.record(frame);
  tracked.record(tracked.track(2), true);
  tracked.put_points_right();
  const double before = tracked.error(1);
  EXPECT_EQ(tracked.sightings.settle(tracked.map, tracked.recorder, 0), 0);
  EXPECT_EQ(tracked.error(1), before);

  Tracked torn;
  torn.record(torn.track(1));
  const double as_recorded = torn.error(1);
  std::mt19937_64 random(4);
  for (const MapPointId id : torn.points) {
    torn.map.set_position(
        id, Eigen::Vector3d(testing::uniform(random, -2, 2), testing::uniform(random, -2, 2), 5));
  }
  EXPECT_EQ(torn.sightings.settle(torn.map, torn.recorder, 0), 0);
  EXPECT_EQ(torn.error(1), as_recorded);
}

TEST(FrameSightings, WhatWasKeptOfAFrameIsReplacedAndForgotten) {
  Tracked tracked;
  TrackedFrame frame = tracked.track(1);
  tracked.record(frame);
  tracked.record(frame);
  EXPECT_EQ(tracked.sightings.size(), 1U);
  frame.clear_associations();
  tracked.sightings.keep(frame);  // it saw nothing: there is nothing to follow
  EXPECT_EQ(tracked.sightings.size(), 0U);
  tracked.record(tracked.track(2));
  tracked.sightings.forget(2);
  EXPECT_EQ(tracked.sightings.size(), 0U);
}

}  // namespace
}  // namespace orbslam
