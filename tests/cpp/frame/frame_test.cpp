// SPDX-License-Identifier: BSD-3-Clause
#include "frame/frame.hpp"

#include <gtest/gtest.h>

#include <utility>

#include "base/errors.hpp"

namespace orbslam {
namespace {

std::shared_ptr<Frame> frame_with_depths(const std::vector<float>& depths) {
  CameraOptions options;
  options.pinhole = {500, 500, 320, 240};
  options.image_size = {640, 480};
  options.bf = 50;
  options.depth_ratio = 30;  // close: below 3 m
  auto frame = std::make_shared<Frame>();
  frame->camera = std::make_shared<Camera>(options);
  frame->keypoints.resize(depths.size());
  frame->right_u.assign(depths.size(), -1.0F);
  frame->depth = depths;
  return frame;
}

TEST(TrackedFrame, StartsWithoutPoseAndAssociations) {
  const TrackedFrame tracked(frame_with_depths({1, 2, 3}));
  EXPECT_FALSE(tracked.T_cw.has_value());
  EXPECT_FALSE(tracked.reference_keyframe().valid());
  EXPECT_EQ(tracked.map_points.size(), 3U);
  EXPECT_EQ(tracked.n_associated(), 0U);
}

TEST(TrackedFrame, ClearingRemovesEveryTraceOfTheAssociations) {
  TrackedFrame tracked(frame_with_depths({1, 2, 3}));
  tracked.T_cw = Pose();
  tracked.anchor.keyframe = KeyFrameId(4);
  tracked.associate(1, MapPointId(9), {1, 2, 3});
  tracked.associate(2, MapPointId(8), {3, 2, 1});
  tracked.outlier[2] = 1;
  EXPECT_EQ(tracked.n_associated(), 2U);
  tracked.clear_associations();
  EXPECT_EQ(tracked.n_associated(), 0U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_FALSE(tracked.map_points[i].valid());
    EXPECT_TRUE(tracked.positions[i].isZero(0));
    EXPECT_EQ(tracked.outlier[i], 0);
  }
  EXPECT_TRUE(tracked.T_cw.has_value());
  EXPECT_EQ(tracked.reference_keyframe(), KeyFrameId(4));
}

TEST(TrackedFrame, DissociatingForgetsTheOutlierFlag) {
  TrackedFrame tracked(frame_with_depths({1}));
  tracked.associate(0, MapPointId(0), {1, 1, 1});
  tracked.outlier[0] = 1;
  tracked.dissociate(0);
  EXPECT_EQ(tracked.n_associated(), 0U);
  EXPECT_EQ(tracked.outlier[0], 0);
}

TEST(TrackedFrame, DiscardingReturnsTheOutliersPointsAndKeepsTheInliers) {
  TrackedFrame tracked(frame_with_depths({1, 2, 3, 4}));
  for (const auto& [i, id] : {std::pair(0U, 9), {1U, 5}, {2U, 7}}) {
    tracked.associate(i, MapPointId(id), {0, 0, 1});
  }
  tracked.outlier = {1, 0, 1, 1};  // the last one has no point
  EXPECT_EQ(tracked.discard_outliers(), (std::vector<MapPointId>{MapPointId(7), MapPointId(9)}));
  EXPECT_EQ(tracked.n_associated(), 1U);
  EXPECT_EQ(tracked.map_points[1], MapPointId(5));
  EXPECT_EQ(tracked.outlier[0], 0);
  EXPECT_TRUE(tracked.discard_outliers().empty());
}

TEST(TrackedFrame, CopiesChosenAssociationsOfAnotherVersionOfItsFrame) {
  const auto frame = frame_with_depths({1, 2, 3});
  TrackedFrame from(frame), to(frame);
  from.associate(0, MapPointId(5), {1, 2, 3});
  from.associate(1, MapPointId(6), {4, 5, 6});
  to.associate(2, MapPointId(9), {7, 8, 9});

  to.copy_associations(from, {0, 1, 1});

  EXPECT_EQ(to.map_points, (std::vector<MapPointId>{MapPointId(), MapPointId(6), MapPointId()}));
  EXPECT_EQ(to.positions[1], Eigen::Vector3d(4, 5, 6));
  EXPECT_THROW(to.copy_associations(TrackedFrame(frame_with_depths({1, 2, 3})), {1, 1, 1}),
               StateError);
  EXPECT_THROW(to.copy_associations(from, {1}), StateError);
}

TEST(TrackedFrame, InliersOfTheMapAreNeitherOutliersNorTemporary) {
  TrackedFrame tracked(frame_with_depths({1, 2, 3, 4}));
  EXPECT_EQ(tracked.n_map_inliers(), 0U);
  tracked.associate(0, MapPointId(0), {0, 0, 1});
  tracked.associate(1, MapPointId(5), {0, 0, 1});
  tracked.associate(2, kFirstTemporaryPoint, {0, 0, 1});
  tracked.outlier[1] = 1;
  EXPECT_EQ(tracked.n_map_inliers(), 1U);
}

TEST(TrackedFrame, CloseCountsTellInliersFromTheRest) {
  //                                        none  close  close  close  limit  far
  TrackedFrame tracked(frame_with_depths({-1.0F, 1.0F, 2.0F, 2.9F, 3.0F, 9.0F}));
  for (const std::size_t i : {0U, 1U, 2U, 4U, 5U}) {
    tracked.associate(i, MapPointId(static_cast<std::int64_t>(i)), {0, 0, 1});
  }
  tracked.outlier[2] = 1;
  const CloseCounts counts = tracked.n_close_tracked_untracked();
  EXPECT_EQ(counts.tracked, 1);
  EXPECT_EQ(counts.untracked, 2);
}

}  // namespace
}  // namespace orbslam
