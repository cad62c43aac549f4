// SPDX-License-Identifier: BSD-3-Clause
#include "frame/right_alignment.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "alignment/made_up_image.hpp"
#include "frame/build_frame.hpp"
#include "frame/stereo_pair.hpp"

namespace orbslam::testing {
namespace {

constexpr double kDisparity = 7.3;
constexpr double kBf = 40;

/// A pair of one texture, the right image shifted by kDisparity columns and `rows` rows, and a
/// frame whose right columns are off by `off` pixels.
std::shared_ptr<Frame> shifted_frame(double off, double rows = 0, bool with_right = true) {
  const Texture texture(3);
  const cv::Size size(200, 150);
  CameraOptions options;
  options.pinhole = {200, 200, 100, 75};
  options.image_size = {size.width, size.height};
  options.bf = kBf;
  options.depth_ratio = 40;
  const FrameContext context{std::make_shared<const Camera>(options),
                             std::make_shared<const ScalePyramid>(1.2F, 3)};
  Features features;
  for (int y = 20; y < 130; y += 10) {
    for (int x = 40; x < 180; x += 10) {
      Keypoint keypoint;
      keypoint.x = static_cast<float>(x);
      keypoint.y = static_cast<float>(y);
      keypoint.level = (x / 10) % 3;
      features.keypoints.push_back(keypoint);
    }
  }
  features.descriptors.resize(features.keypoints.size());
  auto frame = build_monocular_frame(context, 0, 0, std::move(features));
  for (std::size_t i = 0; i < frame->size(); ++i) {
    frame->right_u[i] = frame->keypoints[i].x - static_cast<float>(kDisparity + off);
    frame->depth[i] = static_cast<float>(kBf / (kDisparity + off));
  }
  const auto same = [](const Eigen::Vector2d& p) { return p; };
  const auto moved = [rows](const Eigen::Vector2d& p) {
    return Eigen::Vector2d(p.x() + kDisparity, p.y() + rows);
  };
  FrameImages::Pyramids images;
  images.left = resized_pyramid(picture(texture, same, {}, size), *context.scales);
  if (with_right)
    images.right = resized_pyramid(picture(texture, moved, {}, size), *context.scales);
  frame->images = std::make_shared<FrameImages>(std::move(images));
  return frame;
}

TEST(AlignRightColumns, FindsTheDisparity) {
  const auto frame = shifted_frame(0.4);
  const int n = align_right_columns(*frame, kBf, 200);
  EXPECT_GT(n, static_cast<int>(frame->size() * 9 / 10));
  int n_seen = 0;
  for (std::size_t i = 0; i < frame->size(); ++i) {
    if (frame->right_variance[i] == 0) continue;
    ++n_seen;
    EXPECT_NEAR(frame->keypoints[i].x - frame->right_u[i], kDisparity, 0.08);
    EXPECT_NEAR(frame->depth[i], kBf / kDisparity, 0.1);
    EXPECT_LT(frame->right_variance[i], 0.2F * frame->scales->sigma2(frame->keypoints[i].level));
  }
  EXPECT_EQ(n_seen, n);
}

TEST(AlignRightColumns, TheKeypointsStay) {
  const auto frame = shifted_frame(0.4), before = shifted_frame(0.4);
  align_right_columns(*frame, kBf, 200);
  for (std::size_t i = 0; i < frame->size(); ++i) {
    EXPECT_EQ(frame->keypoints[i].x, before->keypoints[i].x);
    EXPECT_EQ(frame->keypoints[i].y, before->keypoints[i].y);
  }
}

TEST(AlignRightColumns, ColumnsStayWhereRowsDisagree) {
  const auto frame = shifted_frame(0.4, 0.5), before = shifted_frame(0.4, 0.5);
  EXPECT_EQ(align_right_columns(*frame, kBf, 200), 0);
  EXPECT_EQ(frame->right_u, before->right_u);
  EXPECT_TRUE(frame->right_variance.empty());
  // No patch of a pair that is not rectified is aligned in any other frame.
  EXPECT_EQ(frame->images->get(), nullptr);
}

TEST(AlignRightColumns, NothingHappensWithoutImages) {
  const auto lonely = shifted_frame(0.4, 0, false);
  EXPECT_EQ(align_right_columns(*lonely, kBf, 200), 0);
  const auto released = shifted_frame(0.4);
  released->images->release();
  EXPECT_EQ(align_right_columns(*released, kBf, 200), 0);
  EXPECT_TRUE(released->right_variance.empty());
}

}  // namespace
}  // namespace orbslam::testing
