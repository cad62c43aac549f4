// SPDX-License-Identifier: BSD-3-Clause
#include "frame/build_frame.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/errors.hpp"
#include "frame/image_input.hpp"
#include "frame/stereo_matching.hpp"
#include "frame/stereo_pair.hpp"

namespace orbslam {
namespace {

using testing::read_extraction;
using testing::read_npy;
using testing::test_data;

FrameContext context_of(const CameraOptions& options, bool original_coordinates = false) {
  return {std::make_shared<Camera>(options),
          std::make_shared<ScalePyramid>(1.2F, 8, original_coordinates)};
}

CameraOptions rectified_options() {
  CameraOptions options;
  options.pinhole = {500, 500, 320, 240};
  options.image_size = {640, 480};
  options.bf = 40;
  options.depth_ratio = 35;
  return options;
}

CameraOptions distorted_options() {
  CameraOptions options = rectified_options();
  const auto k = read_npy<float>(test_data("golden/undist/K.npy")).values;
  const auto d = read_npy<float>(test_data("golden/undist/dist.npy")).values;
  options.pinhole = {k[0], k[1], k[2], k[3]};
  options.distortion = {d[0], d[1], d[2], d[3], d[4]};
  return options;
}

Features features_at(const std::vector<std::pair<float, float>>& positions) {
  Features features;
  for (const auto& [x, y] : positions) {
    Keypoint keypoint;
    keypoint.x = x;
    keypoint.y = y;
    keypoint.angle = 30;
    keypoint.level = 2;
    features.keypoints.push_back(keypoint);
    Descriptor descriptor;
    descriptor.words[0] = features.keypoints.size();
    features.descriptors.push_back(descriptor);
  }
  return features;
}

cv::Mat constant_depth(float metres) { return {480, 640, CV_32FC1, cv::Scalar(metres)}; }

TEST(BuildFrame, MonocularFrameHasUndistortedAndRawKeypoints) {
  const auto raw = read_npy<float>(test_data("golden/undist/out_kp.npy"));
  const auto expected = read_npy<float>(test_data("golden/undist/out_kpun.npy"));
  std::vector<std::pair<float, float>> positions;
  for (std::size_t i = 0; i < raw.rows(); ++i) positions.emplace_back(raw.at(i, 0), raw.at(i, 1));
  const FrameContext context = context_of(distorted_options());
  const auto frame = build_monocular_frame(context, 7, 1.5, features_at(positions));

  EXPECT_EQ(frame->id, 7);
  EXPECT_EQ(frame->timestamp, 1.5);
  EXPECT_EQ(frame->camera, context.camera);
  EXPECT_EQ(frame->scales, context.scales);
  EXPECT_FALSE(frame->described);
  ASSERT_EQ(frame->size(), raw.rows());
  ASSERT_EQ(frame->raw_keypoints.size(), raw.rows());
  for (std::size_t i = 0; i < raw.rows(); ++i) {
    // The golden numbers end up to 0.3 pixels from the solution.
    EXPECT_NEAR(frame->keypoints[i].x, expected.at(i, 0), 0.4);
    EXPECT_NEAR(frame->keypoints[i].y, expected.at(i, 1), 0.4);
    EXPECT_EQ(frame->raw_keypoints[i].x, raw.at(i, 0));
    EXPECT_EQ(frame->keypoints[i].angle, 30);
    EXPECT_EQ(frame->keypoints[i].level, 2);
    EXPECT_EQ(frame->descriptors[i].words[0], i + 1);
    EXPECT_FALSE(frame->has_depth(i));
    EXPECT_EQ(frame->right_u[i], -1.0F);
  }
  std::vector<std::uint32_t> found;
  frame->grid.features_in_area(frame->keypoints, expected.at(3, 0), expected.at(3, 1), 1, -1, -1,
                               found);
  EXPECT_NE(std::find(found.begin(), found.end(), 3U), found.end());
}

TEST(BuildFrame, RectifiedFramesKeepNoSecondCopyOfTheKeypoints) {
  const auto frame =
      build_monocular_frame(context_of(rectified_options()), 0, 0, features_at({{50, 60}}));
  EXPECT_TRUE(frame->raw_keypoints.empty());
  EXPECT_EQ(frame->keypoints[0].x, 50.0F);
}

TEST(BuildFrame, StereoFrameHasTheMatchersDepth) {
  const ScalePyramid scales(1.2F, 8, true);
  const std::string folder = test_data("golden/stereo_synth");
  const Extraction left = read_extraction(folder, "left", 8, scales);
  const Extraction right = read_extraction(folder, "right", 8, scales);
  const auto k_bf = read_npy<float>(folder + "/K_bf.npy").values;
  CameraOptions options = rectified_options();
  options.pinhole = {k_bf[0], k_bf[1], k_bf[2], k_bf[3]};
  options.bf = k_bf[4];
  const auto frame = build_stereo_frame(context_of(options, true), 1, 0.1, left, right);
  EXPECT_EQ(frame->right_u, read_npy<float>(folder + "/uRight.npy").values);
  EXPECT_EQ(frame->depth, read_npy<float>(folder + "/depth.npy").values);
  EXPECT_EQ(frame->size(), left.features.size());
  for (std::size_t i = 0; i < frame->size(); ++i) {
    if (!frame->has_depth(i)) continue;
    const double disparity = frame->keypoints[i].x - frame->right_u[i];
    EXPECT_NEAR(frame->depth[i], options.bf / disparity, 1e-5 * frame->depth[i]);
  }
}

TEST(BuildFrame, RgbdDepthIsReadInTheNearestRawPixel) {
  cv::Mat depth = constant_depth(0);
  depth.at<float>(60, 50) = 2.0F;
  const auto frame =
      build_rgbd_frame(context_of(rectified_options()), 0, 0,
                       features_at({{49.6F, 60.4F}, {50.4F, 59.6F}, {50.6F, 60}}), depth);
  EXPECT_EQ(frame->depth, (std::vector<float>{2.0F, 2.0F, -1.0F}));
}

TEST(BuildFrame, RgbdDepthIsReadAtTheTruncatedRawPixelOfTheOriginal) {
  cv::Mat depth = constant_depth(0);
  depth.at<float>(60, 50) = 2.0F;
  const auto frame = build_rgbd_frame(context_of(rectified_options(), true), 0, 0,
                                      features_at({{50.9F, 60.9F}, {51, 60}, {50, 59.9F}}), depth);
  EXPECT_EQ(frame->depth, (std::vector<float>{2.0F, -1.0F, -1.0F}));
  EXPECT_EQ(frame->right_u, (std::vector<float>{50.9F - 20.0F, -1.0F, -1.0F}));
}

// OD-34: the undistorted pixel is what is unprojected.
TEST(BuildFrame, RgbdLooksUpRawButProjectsUndistortedCoordinates) {
  cv::Mat depth = constant_depth(-1);
  depth.at<float>(40, 30) = 4.0F;
  const auto frame =
      build_rgbd_frame(context_of(distorted_options()), 0, 0, features_at({{30, 40}}), depth);
  EXPECT_EQ(frame->depth[0], 4.0F);
  EXPECT_GT(std::abs(frame->keypoints[0].x - 30.0F), 5.0F);
  EXPECT_EQ(frame->right_u[0], frame->keypoints[0].x - 10.0F);
  const Eigen::Vector3d point = frame->unproject(0);
  EXPECT_NEAR(frame->camera->pinhole().project(point).x(), frame->keypoints[0].x, 1e-9);
  EXPECT_DOUBLE_EQ(point.z(), 4.0);
}

// OD-35: the depth alone is asked.
TEST(BuildFrame, ANegativeVirtualRightColumnIsStillADepth) {
  const auto frame = build_rgbd_frame(context_of(rectified_options()), 0, 0,
                                      features_at({{20, 100}, {80, 100}}), constant_depth(0.8F));
  EXPECT_FLOAT_EQ(frame->right_u[0], -30.0F);
  EXPECT_TRUE(frame->has_depth(0));
  EXPECT_TRUE(frame->is_close(0));
  EXPECT_FLOAT_EQ(frame->right_u[1], 30.0F);
}

TEST(BuildFrame, WhatIsNoDepth) {
  cv::Mat depth = constant_depth(1);
  const float none[] = {0.0F, -2.0F, NAN, INFINITY};
  for (int i = 0; i < 4; ++i) depth.at<float>(10, 10 + i) = none[i];
  const auto frame = build_rgbd_frame(
      context_of(rectified_options()), 0, 0,
      features_at(
          {{10, 10}, {11, 10}, {12, 10}, {13, 10}, {14, 10}, {700, 10}, {10, 480}, {-2, 5}}),
      depth);
  EXPECT_EQ(frame->depth, (std::vector<float>{-1, -1, -1, -1, 1, -1, -1, -1}));
}

TEST(BuildFrame, CloseIsStrictlyBelowTheLimit) {
  CameraOptions options = rectified_options();
  options.depth_ratio = 25;  // close depth 2 m exactly
  cv::Mat depth = constant_depth(2.0F);
  depth.at<float>(10, 20) = std::nextafter(2.0F, 0.0F);
  const auto frame =
      build_rgbd_frame(context_of(options), 0, 0, features_at({{10, 10}, {20, 10}}), depth);
  EXPECT_FALSE(frame->is_close(0));
  EXPECT_TRUE(frame->is_close(1));
}

TEST(BuildFrame, WrongDepthImagesAreImageErrors) {
  const FrameContext context = context_of(rectified_options());
  const Features features = features_at({{10, 10}});
  for (const cv::Mat& depth :
       {cv::Mat(480, 320, CV_32FC1, cv::Scalar(1)), cv::Mat(479, 640, CV_32FC1, cv::Scalar(1)),
        cv::Mat(480, 640, CV_16UC3), cv::Mat(480, 640, CV_32FC3), cv::Mat()}) {
    EXPECT_THROW(build_rgbd_frame(context, 0, 0, features, depth), ImageError);
  }
}

// As the whole image converted, to the bit.
TEST(BuildFrame, RawDepthIsDividedByTheFactor) {
  cv::Mat raw(480, 640, CV_16UC1);
  cv::randu(raw, 0, 65536);
  std::vector<std::pair<float, float>> points;
  for (int i = 0; i < 47; ++i) {
    points.emplace_back(13.0F * static_cast<float>(i), 5.0F + 9.0F * static_cast<float>(i));
  }
  const FrameContext context = context_of(rectified_options());
  for (const double factor : {5000.0, 1000.0, 0.3, 0.0}) {
    const auto frame = build_rgbd_frame(context, 0, 0, features_at(points), raw, factor);
    const auto same =
        build_rgbd_frame(context, 0, 0, features_at(points), to_depth_metres(raw, factor));
    EXPECT_EQ(frame->depth, same->depth) << factor;
    EXPECT_EQ(frame->right_u, same->right_u) << factor;
  }
  EXPECT_THROW(build_rgbd_frame(context, 0, 0, features_at(points), raw, -1), SettingsError);
}

TEST(BuildFrame, DepthNeedsABaseline) {
  CameraOptions options = rectified_options();
  options.bf = 0;
  const FrameContext context = context_of(options);
  EXPECT_THROW(build_rgbd_frame(context, 0, 0, {}, constant_depth(1)), StateError);
  EXPECT_THROW(build_stereo_frame(context, 0, 0, {}, {}), StateError);
}

// OD-37: they are not left half built.
TEST(BuildFrame, FramesWithoutKeypointsAreComplete) {
  const ScalePyramid scales(1.2F, 8);
  Extraction empty;
  empty.pyramid = testing::resized_pyramid(cv::Mat(480, 640, CV_8UC1, cv::Scalar(9)), scales);
  const FrameContext context = context_of(distorted_options());
  for (const auto& frame :
       {build_monocular_frame(context, 0, 0, {}), build_stereo_frame(context, 0, 0, empty, empty),
        build_rgbd_frame(context, 0, 0, {}, constant_depth(1))}) {
    EXPECT_EQ(frame->size(), 0U);
    EXPECT_TRUE(frame->depth.empty());
    EXPECT_TRUE(frame->right_u.empty());
    EXPECT_TRUE(frame->descriptors.empty());
    EXPECT_GT(frame->camera->baseline(), 0);
    EXPECT_GT(frame->camera->bounds().max_x, 600);
    std::vector<std::uint32_t> found = {1};
    frame->grid.features_in_area(frame->keypoints, 100, 100, 500, -1, -1, found);
    EXPECT_TRUE(found.empty());
    EXPECT_EQ(TrackedFrame(frame).n_associated(), 0U);
  }
}

}  // namespace
}  // namespace orbslam
