// SPDX-License-Identifier: BSD-3-Clause
#include "frame/match_error.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "base/errors.hpp"
#include "frame/build_frame.hpp"

namespace orbslam {
namespace {

/// Keypoints so many pixels to the right of where a point straight ahead is seen, and their levels.
TrackedFrame tracked_frame_with(const std::vector<std::pair<float, int>>& errors) {
  CameraOptions options;
  options.pinhole = {50, 50, 40, 30};
  options.image_size = {80, 60};
  Features features;
  for (const auto& [pixels, level] : errors) {
    Keypoint keypoint;
    keypoint.x = 40 + pixels;
    keypoint.y = 30;
    keypoint.level = level;
    features.keypoints.push_back(keypoint);
    features.descriptors.emplace_back();
  }
  const FrameContext context{std::make_shared<Camera>(options),
                             std::make_shared<ScalePyramid>(1.5F, 4)};
  TrackedFrame frame(build_monocular_frame(context, 0, 0, std::move(features)));
  frame.T_cw = Pose();
  for (std::size_t i = 0; i < errors.size(); ++i) {
    frame.associate(i, MapPointId(static_cast<std::int64_t>(i)), {0, 0, 2});
  }
  return frame;
}

TEST(MatchError, IsTheMedianInDeviationsOfTheLevels) {
  // 1, 2 and 3 deviations.
  EXPECT_NEAR(median_match_error(tracked_frame_with({{1, 0}, {4.5F, 2}, {4.5F, 1}})), 2, 1e-6);
}

TEST(MatchError, CountsOutliersAndPointsBehindTheCamera) {
  TrackedFrame frame = tracked_frame_with({{0.5F, 0}, {3, 0}, {9, 0}});
  frame.outlier[2] = 1;
  EXPECT_NEAR(median_match_error(frame), 3, 1e-6);
  frame.positions[1] = {0, 0, -2};
  EXPECT_NEAR(median_match_error(frame), 9, 1e-6);
  frame.positions[0] = {0, 0, -2};
  EXPECT_EQ(median_match_error(frame), std::numeric_limits<double>::infinity());
}

TEST(MatchError, IsZeroWithoutMatches) {
  TrackedFrame frame = tracked_frame_with({{5, 0}});
  frame.clear_associations();
  EXPECT_EQ(median_match_error(frame), 0);
}

TEST(MatchError, NeedsAPose) {
  TrackedFrame frame = tracked_frame_with({{5, 0}});
  frame.T_cw.reset();
  EXPECT_THROW(median_match_error(frame), StateError);
}

}  // namespace
}  // namespace orbslam
