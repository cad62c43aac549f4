// SPDX-License-Identifier: BSD-3-Clause
#include "frame/keypoint_colours.hpp"

#include <gtest/gtest.h>

#include "base/errors.hpp"
#include "frame/build_frame.hpp"

namespace orbslam {
namespace {

using Colours = std::vector<std::array<std::uint8_t, 3>>;

std::shared_ptr<Frame> frame_at(const std::vector<std::pair<float, float>>& positions,
                                double k1 = 0) {
  CameraOptions options;
  options.pinhole = {50, 50, 32, 24};
  options.image_size = {64, 48};
  options.distortion[0] = k1;
  Features features;
  for (const auto& [x, y] : positions) {
    Keypoint keypoint;
    keypoint.x = x;
    keypoint.y = y;
    features.keypoints.push_back(keypoint);
    features.descriptors.emplace_back();
  }
  const FrameContext context{std::make_shared<Camera>(options),
                             std::make_shared<ScalePyramid>(1.2F, 8)};
  return build_monocular_frame(context, 0, 0, std::move(features));
}

/// Each pixel is (column, row, 7), then alpha.
cv::Mat numbered_image(int channels) {
  cv::Mat image(48, 64, CV_8UC(channels));
  for (int row = 0; row < image.rows; ++row) {
    for (int column = 0; column < image.cols; ++column) {
      std::uint8_t* pixel = image.ptr<std::uint8_t>(row) + column * channels;
      for (int c = 0; c < channels; ++c) {
        pixel[c] = static_cast<std::uint8_t>(c == 0 ? column : c == 1 ? row : 5 + c);
      }
    }
  }
  return image;
}

TEST(KeypointColours, AreThoseOfTheNearestPixel) {
  const auto frame = frame_at({{10, 20}, {10.4F, 19.6F}, {10.6F, 20.4F}, {63.9F, 47.9F}});
  sample_colours(numbered_image(3), true, *frame);
  EXPECT_EQ(frame->colours, (Colours{{10, 20, 7}, {10, 20, 7}, {11, 20, 7}, {63, 47, 7}}));
}

TEST(KeypointColours, AreRedGreenBlueWhateverTheOrderOfTheImage) {
  const auto frame = frame_at({{10, 20}});
  sample_colours(numbered_image(3), false, *frame);
  EXPECT_EQ(frame->colours, (Colours{{7, 20, 10}}));
  sample_colours(numbered_image(4), false, *frame);
  EXPECT_EQ(frame->colours, (Colours{{7, 20, 10}}));
}

TEST(KeypointColours, AreReadInTheImageAsItWasGiven) {
  const auto frame = frame_at({{4, 5}}, -0.3);
  ASSERT_GT(std::abs(frame->keypoints[0].x - 4), 1);
  sample_colours(numbered_image(3), true, *frame);
  EXPECT_EQ(frame->colours, (Colours{{4, 5, 7}}));
}

TEST(KeypointColours, OfAPartOfALargerImageFollowItsRows) {
  cv::Mat large(100, 100, CV_8UC3, cv::Scalar::all(0));
  cv::Mat part = large(cv::Rect(20, 30, 64, 48));
  numbered_image(3).copyTo(part);
  const auto frame = frame_at({{10, 20}});
  sample_colours(part, true, *frame);
  EXPECT_EQ(frame->colours, (Colours{{10, 20, 7}}));
}

TEST(KeypointColours, OfAGreyImageAreNone) {
  const auto frame = frame_at({{10, 20}});
  EXPECT_TRUE(frame->colours.empty());
  sample_colours(numbered_image(3), true, *frame);
  sample_colours(numbered_image(1), true, *frame);
  EXPECT_TRUE(frame->colours.empty());
}

TEST(KeypointColours, ComeFromTheFramesImageOnly) {
  const auto frame = frame_at({{10, 20}});
  for (const cv::Mat& image : {cv::Mat(), cv::Mat(48, 63, CV_8UC3), cv::Mat(47, 64, CV_8UC3),
                               cv::Mat(48, 64, CV_16UC3), cv::Mat(48, 64, CV_8UC2)}) {
    EXPECT_THROW(sample_colours(image, true, *frame), ImageError);
  }
}

}  // namespace
}  // namespace orbslam
