// SPDX-License-Identifier: BSD-3-Clause
#include "frame/rig_frame.hpp"

#include <gtest/gtest.h>

#include "base/errors.hpp"
#include "support/rigs.hpp"

namespace orbslam {
namespace {

FrameContext rig_context() {
  return {testing::make_rig(), std::make_shared<const ScalePyramid>(1.2F, 8)};
}

std::shared_ptr<Frame> frame_of(const FrameContext& rig, std::size_t camera, float x, float z) {
  Features features;
  Keypoint keypoint;
  keypoint.x = x;
  keypoint.y = 100;
  features.keypoints = {keypoint};
  features.descriptors.resize(1);
  const FrameContext own{rig.camera->members()[camera].camera, rig.scales};
  const cv::Mat depth(480, 640, CV_32F, cv::Scalar(z));
  return build_rgbd_frame(own, 3, 0.5, features, depth);
}

TEST(JoinFrames, PutsTheKeypointsOfEachCameraIntoItsColumns) {
  const FrameContext rig = rig_context();
  const auto joined = join_frames(
      rig, 3, 0.5, {frame_of(rig, 0, 200, 2), nullptr, frame_of(rig, 2, 310, 4), nullptr});
  ASSERT_EQ(joined->size(), 2U);
  EXPECT_EQ(joined->raw_keypoints.size(), 2U);
  EXPECT_EQ(rig.camera->camera_at(joined->keypoints[0].x), 0U);
  EXPECT_EQ(rig.camera->camera_at(joined->keypoints[1].x), 2U);
  EXPECT_NEAR(joined->raw_keypoints[1].x, 310 + rig.camera->column_of(2), 1e-3);
  // The camera to the rear measures 4 m along its axis, 0.3 m behind the body.
  EXPECT_NEAR(joined->unproject(1).z(), -4.3, 1e-4);
  EXPECT_NEAR(joined->keypoints[1].x - joined->right_u[1], 55.0 / 4, 1e-3);
  EXPECT_TRUE(joined->center_of(1, Pose()).isApprox(Eigen::Vector3d(0, 0.05, -0.3)));
  std::vector<std::uint32_t> found;
  joined->grid.features_in_area(joined->keypoints, joined->keypoints[1].x, joined->keypoints[1].y,
                                5, -1, -1, found);
  EXPECT_EQ(found, std::vector<std::uint32_t>{1});
}

TEST(JoinFrames, RefusesFramesOfOtherCameras) {
  const FrameContext rig = rig_context();
  const auto frame = frame_of(rig, 0, 200, 2);
  EXPECT_THROW(join_frames(rig, 3, 0.5, {frame}), StateError);
  EXPECT_THROW(join_frames(rig, 3, 0.5, {nullptr, frame, nullptr, nullptr}), StateError);
}

TEST(RigExtractor, GivesWhatOneExtractorGivesForEachImage) {
  cv::Mat image(240, 320, CV_8UC1);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      image.at<std::uint8_t>(v, u) =
          static_cast<std::uint8_t>(((u / 13) * 37 + (v / 11) * 61) % 251);
    }
  }
  const cv::Mat part = image.colRange(0, 200).clone();
  OrbOptions options;
  options.n_features = 200;
  RigExtractor extractor(options, 3);
  const auto all = extractor.extract({image, {}, part}, {{}, {}, {}});
  OrbExtractor one(options);
  EXPECT_EQ(all[0].features.descriptors.size(), one.extract(image).features.descriptors.size());
  EXPECT_EQ(all[1].features.size(), 0U);
  EXPECT_EQ(all[2].features.descriptors, one.extract(part).features.descriptors);
  EXPECT_GT(all[2].features.size(), 50U);
  EXPECT_THROW(extractor.extract({image}, {{}}), StateError);
}

}  // namespace
}  // namespace orbslam
