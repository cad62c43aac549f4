// SPDX-License-Identifier: BSD-3-Clause
#include "frame/velocity.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "base/errors.hpp"
#include "frame/build_frame.hpp"

namespace orbslam {
namespace {

constexpr double kTolerance = 1e-12;

/// One radian a second about y, and a metre a second along the camera's x.
Pose turning(double seconds) {
  Vector6d tangent;
  tangent << 0, seconds, 0, seconds, 0, 0;
  return Pose::exp(tangent);
}

Pose moved(double x) { return Pose(Eigen::Quaterniond::Identity(), {x, 0, 0}); }

void expect_same(const Pose& pose, const Pose& expected) {
  EXPECT_TRUE(pose.matrix().isApprox(expected.matrix(), kTolerance)) << pose.matrix();
}

/// Frame `id` at 10 Hz, without keypoints unless it is told of some pixels.
TrackedFrame frame_at(FrameId id, const std::optional<Pose>& T_cw,
                      const std::vector<float>& columns = {}) {
  CameraOptions options;
  options.pinhole = {50, 50, 40, 30};
  options.image_size = {80, 60};
  Features features;
  for (const float x : columns) {
    Keypoint keypoint;
    keypoint.x = x;
    keypoint.y = 30;
    features.keypoints.push_back(keypoint);
    features.descriptors.emplace_back();
  }
  const FrameContext context{std::make_shared<Camera>(options),
                             std::make_shared<ScalePyramid>(1.5F, 4)};
  TrackedFrame frame(
      build_monocular_frame(context, id, 0.1 * static_cast<double>(id), std::move(features)));
  frame.T_cw = T_cw;
  return frame;
}

TEST(Velocity, GivesTheMeasuredMotionOverTheMeasuredInterval) {
  const Velocity velocity{turning(0.1), 0.1};
  EXPECT_EQ(velocity.over(0.3 - 0.2).matrix(), velocity.step.matrix());
}

TEST(Velocity, GivesMultiplesAndTheInverse) {
  const Velocity velocity{turning(0.1), 0.1};
  expect_same(velocity.over(0.2), turning(0.1) * turning(0.1));
  expect_same(velocity.over(-0.1), turning(0.1).inverse());
  // Frames before the start are tracked backwards: interval and motion are negative.
  expect_same(Velocity{turning(0.1).inverse(), -0.1}.over(-0.2), turning(0.2).inverse());
}

TEST(Velocity, IsConstantForOneSecond) {
  expect_same(Velocity{turning(0.1), 0.1}.over(60), turning(1));
  expect_same(Velocity{turning(0.1), 0.1}.over(-60), turning(-1));
}

TEST(Velocity, IsScaledInItsTranslation) {
  const Velocity scaled = Velocity{turning(0.1), 0.1}.scaled(3);
  EXPECT_TRUE(scaled.step.translation().isApprox(3 * turning(0.1).translation()));
  EXPECT_TRUE(scaled.step.rotation().isApprox(turning(0.1).rotation()));
  EXPECT_EQ(scaled.seconds, 0.1);
}

TEST(Velocity, IsMeasuredBetweenTwoPoses) {
  const TrackedFrame first = frame_at(3, turning(0.3));
  const auto velocity = velocity_between(first, frame_at(4, turning(0.4)), true);
  ASSERT_TRUE(velocity);
  EXPECT_NEAR(velocity->seconds, 0.1, kTolerance);
  expect_same(velocity->step, turning(0.1));
  EXPECT_FALSE(velocity_between(first, frame_at(4, std::nullopt), false));
  EXPECT_FALSE(velocity_between(frame_at(3, std::nullopt), first, false));
}

TEST(Velocity, IsOfConsecutiveFramesWhereThatIsAsked) {
  const TrackedFrame first = frame_at(3, turning(0.3));
  EXPECT_FALSE(velocity_between(first, frame_at(5, turning(0.5)), true));
  EXPECT_NEAR(velocity_between(first, frame_at(5, turning(0.5)), false)->seconds, 0.2, kTolerance);
  // Backwards, towards frames of before the start of a map.
  EXPECT_NEAR(velocity_between(first, frame_at(2, turning(0.2)), false)->seconds, -0.1, kTolerance);
  TrackedFrame after_loop = frame_at(4, turning(0.4));
  after_loop.anchor.big_change = 1;
  EXPECT_FALSE(velocity_between(first, after_loop, true));
}

TEST(PredictPose, ContinuesTheMotion) {
  TrackedFrame last = frame_at(1, turning(0.1));
  last.anchor.keyframe = KeyFrameId(7);
  const Velocity velocity{turning(0.1), 0.1};
  TrackedFrame frame = frame_at(4, std::nullopt);
  predict_pose(frame, last, &velocity);
  expect_same(*frame.T_cw, turning(0.4));
  EXPECT_EQ(frame.reference_keyframe(), KeyFrameId(7));
  predict_pose(frame, last, nullptr);
  EXPECT_EQ(frame.T_cw->matrix(), last.T_cw->matrix());
  EXPECT_THROW(predict_pose(frame, frame_at(1, std::nullopt), nullptr), StateError);
}

TEST(Innovation, IsFromThePoseToThePredictedOne) {
  const TrackedFrame last = frame_at(1, moved(1));
  const Velocity velocity{moved(1), 0.1};
  Vector6d expected = Vector6d::Zero();
  expected[3] = 0.5;
  const auto tangent = innovation(frame_at(2, moved(1.5)), last, velocity);
  ASSERT_TRUE(tangent);
  EXPECT_TRUE(tangent->isApprox(expected, kTolerance));
  EXPECT_FALSE(innovation(frame_at(2, std::nullopt), last, velocity));
}

TEST(Innovation, GivesTheChangeFromThePrediction) {
  const TrackedFrame last = frame_at(1, Pose());
  const Velocity velocity{turning(0.1), 0.1};
  const Pose beside = moved(-0.25) * turning(0.15);
  const PoseChange change = change_from_prediction(frame_at(2, beside), last, &velocity);
  EXPECT_NEAR(change.turn, 0.05, kTolerance);
  EXPECT_NEAR(change.move, (beside.center() - turning(0.1).center()).norm(), kTolerance);
  EXPECT_EQ(change_from_prediction(frame_at(2, beside), last, nullptr).turn, 0);
  EXPECT_EQ(change_from_prediction(frame_at(2, std::nullopt), last, &velocity).move, 0);
}

TEST(StatedCovariance, GrowsByTheMotionOfTheMapAndByTheInnovation) {
  const TrackedFrame last = frame_at(1, moved(1)), frame = frame_at(2, moved(1.5));
  const Matrix6d covariance = Vector6d(1, 2, 3, 4, 5, 6).asDiagonal();
  EXPECT_EQ(stated_covariance(covariance, 2, frame, last, {}), 2 * covariance);
  // The prediction is half a metre further along x, and the map has moved by two metres along y.
  const Velocity velocity{moved(1), 0.1};
  const Pose map_motion(Eigen::Quaterniond::Identity(), {0, 2, 0});
  Matrix6d expected = 2 * covariance;
  expected(3, 3) += 0.04 * 0.25;
  expected(4, 4) += 4;
  const Matrix6d stated =
      stated_covariance(covariance, 2, frame, last, {&velocity, &map_motion, 0.04});
  EXPECT_TRUE(stated.isApprox(expected, kTolerance)) << stated;
  // Without a pose nothing is known of either.
  EXPECT_EQ(stated_covariance(covariance, 2, frame_at(2, std::nullopt), last,
                              {&velocity, &map_motion, 0.04}),
            2 * covariance);
}

TEST(CountStaying, LooksSoManyIntervalsAhead) {
  // Points a metre ahead at columns 10, 40 and 70 of 80; they move by 20 pixels an interval.
  TrackedFrame frame = frame_at(2, Pose(), {10, 40, 70});
  for (std::size_t i = 0; i < 3; ++i) {
    frame.associate(i, MapPointId(static_cast<std::int64_t>(i)),
                    {0.6 * static_cast<double>(i) - 0.6, 0, 1});
  }
  const Velocity velocity{moved(0.4), 0.1};
  EXPECT_EQ(count_staying_after(frame, velocity, 0), 3);
  EXPECT_EQ(count_staying_after(frame, velocity, 1), 2);
  EXPECT_EQ(count_staying_after(frame, velocity, 3), 1);
  EXPECT_THROW(count_staying_after(frame_at(2, std::nullopt), velocity, 1), StateError);
}

}  // namespace
}  // namespace orbslam
