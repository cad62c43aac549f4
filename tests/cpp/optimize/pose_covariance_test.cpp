// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "base/errors.hpp"
#include "frame/build_frame.hpp"
#include "optimize/pose_optimization.hpp"

namespace orbslam {
namespace {

/// A grid of keypoints on a wall with steps, each associated with the point it was taken of; every
/// pixel is moved by `noise` to either side in turns.
TrackedFrame frame_with_pose(float noise) {
  CameraOptions options;
  options.pinhole = {50, 50, 40, 30};
  options.image_size = {80, 60};
  Features features;
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 48; ++i) {
    const int column = i % 8, row = i / 8;
    const Eigen::Vector3d point((column - 3.5) * 0.2, (row - 2.5) * 0.2, 2 + i % 3);
    const Eigen::Vector2d pixel = options.pinhole.project(point);
    Keypoint keypoint;
    keypoint.x = static_cast<float>(pixel.x()) + (i % 2 == 0 ? noise : -noise);
    keypoint.y = static_cast<float>(pixel.y()) + (i % 5 < 2 ? noise : -noise);
    features.keypoints.push_back(keypoint);
    features.descriptors.emplace_back();
    points.push_back(point);
  }
  const FrameContext context{std::make_shared<Camera>(options),
                             std::make_shared<ScalePyramid>(1.2F, 8)};
  TrackedFrame frame(build_monocular_frame(context, 0, 0, std::move(features)));
  frame.T_cw = Pose();
  for (std::size_t i = 0; i < points.size(); ++i) {
    frame.associate(i, MapPointId(static_cast<std::int64_t>(i)), points[i]);
  }
  return frame;
}

TEST(PoseCovariance, AnExactFitIsAsUncertainAsItsKeypoints) {
  TrackedFrame exact = frame_with_pose(0), noisy = frame_with_pose(0.5F);
  EXPECT_LT(optimize_pose(exact).covariance.norm(), 1e-9);
  const Matrix6d told = pose_covariance(exact);
  const PoseEstimate estimate = optimize_pose(noisy);
  ASSERT_EQ(estimate.n_inliers, 48);
  // Noise of 0.5 pixels is a quarter of the variance that the keypoints are taken for.
  const double measured = estimate.covariance.norm() / told.norm();
  EXPECT_NEAR(measured, 0.25 * 96 / 90, 0.03);
  EXPECT_LT((estimate.covariance - measured * told).norm(), 0.1 * measured * told.norm());
}

TEST(PoseCovariance, ThePoseStaysAndOutliersTakeNoPart) {
  TrackedFrame frame = frame_with_pose(0);
  const Matrix6d all = pose_covariance(frame);
  for (std::size_t i = 0; i < 24; ++i) frame.outlier[i] = 1;
  const Matrix6d half = pose_covariance(frame);
  EXPECT_GT(half.trace(), 1.5 * all.trace());
  EXPECT_EQ(frame.T_cw->matrix(), Pose().matrix());
  EXPECT_EQ(frame.outlier[0], 1);
  EXPECT_EQ(half, half.transpose());
}

TEST(PoseCovariance, NothingIsKnownOfFewAssociations) {
  TrackedFrame frame = frame_with_pose(0);
  for (std::size_t i = 2; i < 48; ++i) frame.dissociate(i);
  EXPECT_EQ(pose_covariance(frame), Matrix6d::Zero());
  frame.clear_associations();
  EXPECT_EQ(pose_covariance(frame), Matrix6d::Zero());
}

TEST(PoseCovariance, NeedsAPose) {
  TrackedFrame frame = frame_with_pose(0);
  frame.T_cw.reset();
  EXPECT_THROW(pose_covariance(frame), StateError);
}

}  // namespace
}  // namespace orbslam
