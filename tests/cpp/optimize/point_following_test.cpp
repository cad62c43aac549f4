// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/point_following.hpp"

#include <gtest/gtest.h>

#include "base/errors.hpp"
#include "optimize/keyframe_alignment.hpp"
#include "optimize/pose_optimization.hpp"
#include "optimize/textured_wall.hpp"

namespace orbslam::testing {
namespace {

/// A wall with patches, and the newest keyframe as a tracked frame with all of its points.
struct FollowedWall {
  Wall wall;
  TrackedFrame earlier;
  FrameContext context;

  FollowedWall() : earlier(start(wall)) {
    const KeyFrame& newest = *wall.map.find(KeyFrameId(Wall::kKeyframes - 1));
    context = {newest.frame->camera, newest.frame->scales};
    earlier.T_cw = wall.truth.back();
    for (std::size_t i = 0; i < newest.map_points.size(); ++i) {
      const MapPoint* point = wall.map.find(newest.map_points[i]);
      if (point != nullptr) earlier.associate(i, point->id, point->position);
    }
  }

  FollowedPoints follow(int image, const Pose& predicted) const {
    return follow_points(wall.map, context, earlier, predicted,
                         wall.left[static_cast<std::size_t>(image)]);
  }
  TrackedFrame frame_of(const FollowedPoints& points) const {
    return TrackedFrame(build_monocular_frame(context, 9, 1.0, points.extraction.features));
  }

 private:
  static TrackedFrame start(Wall& wall) {
    const KeyFrameId newest(Wall::kKeyframes - 1);
    align_keyframes(wall.map, newest);
    return TrackedFrame(wall.map.find(newest)->frame);
  }
};

TEST(FollowPoints, FindsThePoseOfAnImageWithoutFeatures) {
  FollowedWall w;
  // The camera stands 0.1 m away; the prediction is wrong by 2 cm and half a degree.
  const Pose wrong(Eigen::Quaterniond(Eigen::AngleAxisd(0.009, Eigen::Vector3d::UnitY())),
                   Eigen::Vector3d(0.01, 0.02, 0));
  const Pose& truth = w.wall.truth[2];
  const FollowedPoints points = w.follow(2, wrong * truth);
  ASSERT_TRUE(points.T_cw.has_value());
  EXPECT_GT(points.n_in_view, 9 * points.n_patches / 10);
  EXPECT_GT(points.points.size(), 8 * points.n_in_view / 10);
  // The points of the wall are wrong by up to 2 cm, and the places of their patches by 0.7 pixels.
  EXPECT_LT((points.T_cw->center() - truth.center()).norm(), 0.03);

  TrackedFrame frame = w.frame_of(points);
  w.wall.map.noise().forget();
  associate(w.wall.map, frame, points);
  EXPECT_EQ(frame.n_associated(), points.points.size());
  EXPECT_GT(optimize_pose(frame).n_inliers, static_cast<int>(8 * points.points.size() / 10));
  EXPECT_LT((frame.T_cw->center() - truth.center()).norm(), 0.03);
  for (std::size_t i = 0; i < frame.map_points.size(); ++i) {
    ASSERT_NE(frame.aligned_at(i), nullptr);
    EXPECT_EQ(frame.aligned_at(i)->u, frame.frame->keypoints[i].x);
  }
}

TEST(FollowPoints, KeypointsHaveTheDescriptorsOfTheirPoints) {
  const FollowedWall w;
  const FollowedPoints points = w.follow(3, w.wall.truth[3]);
  ASSERT_FALSE(points.points.empty());
  for (std::size_t i = 0; i < points.points.size(); ++i) {
    const MapPoint& point = *w.wall.map.find(points.points[i]);
    EXPECT_EQ(points.extraction.features.descriptors[i], point.descriptor);
    EXPECT_EQ(points.positions[i], point.position);
  }
}

TEST(FollowPoints, AnotherImageGivesNoPose) {
  const FollowedWall w;
  const cv::Mat black(w.wall.left[0].size(), CV_8UC1, cv::Scalar(30));
  const FollowedPoints points =
      follow_points(w.wall.map, w.context, w.earlier, w.wall.truth[3], black);
  EXPECT_FALSE(points.T_cw.has_value());
  EXPECT_EQ(points.points.size(), 0U);
  EXPECT_GT(points.n_patches, 0U);
}

TEST(FollowPoints, APredictionFarAwayGivesNoPose) {
  const FollowedWall w;
  const Pose turned(Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY())),
                    Eigen::Vector3d::Zero());
  EXPECT_FALSE(w.follow(3, turned * w.wall.truth[3]).T_cw.has_value());
}

TEST(FollowPoints, PointsWithoutPatchesAreLeftOut) {
  FollowedWall w;
  for (MapPointId& point : w.earlier.map_points) point = MapPointId();
  EXPECT_EQ(w.follow(3, w.wall.truth[3]).n_patches, 0U);
}

TEST(FollowPoints, AFrameOfOtherKeypointsIsRefused) {
  const FollowedWall w;
  TrackedFrame other(w.earlier.frame);
  EXPECT_THROW(associate(w.wall.map, other, w.follow(3, w.wall.truth[3])), StateError);
}

}  // namespace
}  // namespace orbslam::testing
