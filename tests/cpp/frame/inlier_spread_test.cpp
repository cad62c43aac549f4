// SPDX-License-Identifier: BSD-3-Clause
#include "frame/inlier_spread.hpp"

#include <gtest/gtest.h>

#include "base/errors.hpp"
#include "support/small_frame.hpp"

namespace orbslam {
namespace {

TEST(InlierSpread, CountsCellsAndOctavesOfDepth) {
  TrackedFrame frame = tracked_frame_at({{1, 1}, {2, 8}, {79, 59}, {45, 25}, {5, 55}});
  frame.T_cw = Pose(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, 1));
  frame.associate(0, MapPointId(0), {0, 0, 1.0});    // z = 2
  frame.associate(1, MapPointId(1), {0, 0, 2.5});    // 3.5: the same cell and octave
  frame.associate(2, MapPointId(2), {0, 0, 3.5});    // 4.5
  frame.associate(3, MapPointId(3), {0, 0, -0.75});  // 0.25
  const InlierSpread spread = spread_of_inliers(frame);
  EXPECT_EQ(spread.cells, 3);
  EXPECT_EQ(spread.octaves, 3);
}

TEST(InlierSpread, LeavesOutliersOut) {
  TrackedFrame frame = tracked_frame_at({{1, 1}, {79, 59}});
  frame.T_cw = Pose();
  frame.associate(0, MapPointId(0), {0, 0, 2});
  frame.associate(1, MapPointId(1), {0, 0, 9});
  frame.outlier[1] = 1;
  EXPECT_EQ(spread_of_inliers(frame).cells, 1);
  EXPECT_EQ(spread_of_inliers(frame).octaves, 1);
  frame.clear_associations();
  EXPECT_EQ(spread_of_inliers(frame).cells, 0);
}

TEST(InlierSpread, StatesNoCovarianceOfFewResiduals) {
  TrackedFrame frame = tracked_frame_at({{1, 1}, {79, 59}, {79, 1}});
  frame.T_cw = Pose();
  EXPECT_TRUE(spread_of_inliers(frame).covariance.isZero());
  for (std::size_t i = 0; i < 3; ++i) {
    frame.associate(i, MapPointId(static_cast<std::int64_t>(i)), {0, 0, 2});
  }
  EXPECT_TRUE(spread_of_inliers(frame).covariance.isZero());
}

TEST(CountStaying, LeavesOutWhatATurnTakesOutOfView) {
  TrackedFrame frame = tracked_frame_at({{10, 30}, {40, 30}, {70, 30}, {40, 50}});
  frame.T_cw = Pose();
  // At depth 2, where the keypoints lie: x = (u - 40) / 50 * 2.
  frame.associate(0, MapPointId(0), {-1.2, 0, 2});
  frame.associate(1, MapPointId(1), {0, 0, 2});
  frame.associate(2, MapPointId(2), {1.2, 0, 2});
  frame.associate(3, MapPointId(3), {0, 0.8, 2});
  frame.outlier[3] = 1;
  EXPECT_EQ(count_staying(frame, Pose()), 3);
  // To the right: the left one leaves.
  const auto turned = [](double angle) {
    return Pose(Eigen::Quaterniond(Eigen::AngleAxisd(-angle, Eigen::Vector3d::UnitY())),
                Eigen::Vector3d::Zero());
  };
  EXPECT_EQ(count_staying(frame, turned(0.3)), 2);
  EXPECT_EQ(count_staying(frame, turned(3.1)), 0);
}

TEST(MedianDisplacement, IsHowFarThePointsMoveInTheImage) {
  TrackedFrame frame = tracked_frame_at({{10, 30}, {40, 30}, {70, 30}, {40, 50}});
  frame.T_cw = Pose();
  const Pose aside(Eigen::Quaterniond::Identity(), {0.2, 0, 0});
  EXPECT_EQ(median_displacement(frame, aside), 0);  // nothing is known
  frame.associate(0, MapPointId(0), {-1.2, 0, 2});
  frame.associate(1, MapPointId(1), {0, 0, 4});
  frame.associate(2, MapPointId(2), {1.2, 0, 1});
  EXPECT_EQ(median_displacement(frame, Pose()), 0);
  // f = 50: by 5, 2.5 and 10 pixels.
  EXPECT_NEAR(median_displacement(frame, aside), 5, 1e-9);
  frame.outlier[2] = 1;
  frame.associate(3, MapPointId(3), {0, 0, -1});  // behind both
  EXPECT_NEAR(median_displacement(frame, aside), 5, 1e-9);
}

TEST(MedianDisplacement, NeedsAPose) {
  const TrackedFrame frame = tracked_frame_at({{1, 1}});
  EXPECT_THROW(median_displacement(frame, Pose()), StateError);
}

TEST(InlierSpread, NeedsAPose) {
  const TrackedFrame frame = tracked_frame_at({{1, 1}});
  EXPECT_THROW(spread_of_inliers(frame), StateError);
}

}  // namespace
}  // namespace orbslam
