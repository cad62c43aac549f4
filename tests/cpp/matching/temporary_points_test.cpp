// SPDX-License-Identifier: BSD-3-Clause
#include "matching/temporary_points.hpp"

#include <gtest/gtest.h>

#include "base/errors.hpp"
#include "matching/by_projection.hpp"
#include "scenes.hpp"

namespace orbslam::testing {
namespace {

/// n_close keypoints nearer than 4 m and n_far behind, in mixed order.
TrackedFrame frame_with_depths(std::size_t n_close, std::size_t n_far) {
  std::vector<FeatureSpec> features;
  std::mt19937_64 random(3);
  for (std::size_t i = 0; i < std::max(n_close, n_far); ++i) {
    FeatureSpec spec = feature(static_cast<std::int32_t>(i % 8), 0, static_cast<float>(10 + i));
    spec.descriptor = random_descriptor(random);
    spec.depth = 8 + 0.01F * static_cast<float>(i);
    if (i < n_far) features.push_back(spec);
    spec.depth = 1 + 0.01F * static_cast<float>(i);
    if (i < n_close) features.push_back(spec);
  }
  features.push_back(feature(0));  // one without depth
  TrackedFrame frame(make_synthetic_frame(5, features));
  Vector6d xi;
  xi << 0.1, 0.2, -0.1, 1, -2, 0.5;
  frame.T_cw = Pose::exp(xi);
  return frame;
}

std::size_t n_added(std::size_t n_close, std::size_t n_far) {
  TrackedFrame last = frame_with_depths(n_close, n_far);
  PointBatch points;
  const std::size_t n = add_temporary_points(last, points);
  EXPECT_EQ(points.size(), n);
  EXPECT_EQ(last.n_associated(), n);
  EXPECT_EQ(count_map_points(last), 0U);
  return n;
}

TEST(TemporaryPoints, AllCloseOnesOneFarOneAndMoreThanAHundredIfThereAre) {
  EXPECT_EQ(n_added(150, 300), 151U);
  EXPECT_EQ(n_added(50, 300), 101U);
  EXPECT_EQ(n_added(0, 300), 101U);
  EXPECT_EQ(n_added(150, 0), 150U);
  EXPECT_EQ(n_added(0, 60), 60U);
  EXPECT_EQ(n_added(0, 0), 0U);
}

TEST(TemporaryPoints, AreWhatTheFrameMeasures) {
  TrackedFrame last = frame_with_depths(20, 30);
  PointBatch points;
  add_temporary_points(last, points);
  const Eigen::Vector3d center = last.T_cw->center();
  float previous = 0;
  for (std::size_t k = 0; k < points.size(); ++k) {
    const auto i = static_cast<std::size_t>(points.ids[k].value - kFirstTemporaryPoint.value);
    ASSERT_LT(i, last.frame->size());
    EXPECT_TRUE(is_temporary(points.ids[k]));
    EXPECT_EQ(last.map_points[i], points.ids[k]);
    EXPECT_EQ(last.positions[i], points.positions[k]);
    EXPECT_TRUE((*last.T_cw * points.positions[k]).isApprox(last.frame->unproject(i), 1e-9));
    EXPECT_LE(previous, last.frame->depth[i]);
    previous = last.frame->depth[i];
    const Eigen::Vector3d ray = points.positions[k] - center;
    EXPECT_TRUE(points.mean_directions[k].isApprox(ray.normalized(), 1e-12));
    const double level = last.frame->keypoints[i].level;
    EXPECT_NEAR(points.max_distances[k], ray.norm() * std::pow(1.2, level), 1e-5 * ray.norm());
    EXPECT_NEAR(points.max_distances[k] / points.min_distances[k], std::pow(1.2, 7), 1e-5);
    EXPECT_EQ(points.descriptors[k].words, last.frame->descriptors[i].words);
  }
}

TEST(TemporaryPoints, KeypointsWithMapPointsCountButGetNone) {
  TrackedFrame last = frame_with_depths(50, 300);
  int n_held = 0;
  for (std::size_t i = 0; i < last.frame->size() && n_held < 30; ++i) {
    if (!last.frame->is_close(i)) continue;
    last.associate(i, MapPointId(n_held++), {0, 0, 5});
  }
  PointBatch points;
  EXPECT_EQ(add_temporary_points(last, points), 71U);
  EXPECT_EQ(count_map_points(last), 30U);
  EXPECT_EQ(last.n_associated(), 101U);
  EXPECT_EQ(discard_temporary(last), 71U);
  EXPECT_EQ(last.n_associated(), 30U);
  EXPECT_EQ(discard_temporary(last), 0U);
}

TEST(TemporaryPoints, OldOnesMakeRoom) {
  TrackedFrame last = frame_with_depths(40, 0);
  // Made of another frame: the same id as that of keypoint 3 here, in another place.
  last.associate(5, MapPointId(kFirstTemporaryPoint.value + 3), {9, 9, 9});
  last.associate(40, MapPointId(kFirstTemporaryPoint.value + 4), {9, 9, 9});  // without depth
  PointBatch points;
  EXPECT_EQ(add_temporary_points(last, points), 40U);
  EXPECT_EQ(last.map_points[5].value, kFirstTemporaryPoint.value + 5);
  EXPECT_FALSE(last.map_points[40].valid());
}

TEST(TemporaryPoints, LetTheNextFrameBeTrackedWithoutAMap) {
  std::mt19937_64 random(4);
  const PointCloud cloud = make_point_cloud(300, 2, 3, 9, 4);
  const ProjectedFrame before = project_cloud(0, cloud, Pose());
  const Pose T_cw = small_motion(random, 0.01, 0.03);
  const ProjectedFrame after = project_cloud(1, cloud, T_cw);
  TrackedFrame last(before.frame), current(after.frame);
  last.T_cw = Pose();
  current.T_cw = Pose();
  PointBatch points;
  const auto n = static_cast<int>(add_temporary_points(last, points));
  ASSERT_GE(n, 101);
  EXPECT_GE(match_last_frame(current, last, points, 15, true), n * 9 / 10);
  EXPECT_EQ(count_map_points(current), 0U);
  for (std::size_t j = 0; j < current.map_points.size(); ++j) {
    if (!current.map_points[j].valid()) continue;
    const auto i =
        static_cast<std::size_t>(current.map_points[j].value - kFirstTemporaryPoint.value);
    EXPECT_EQ(before.points[i], after.points[j]);
    EXPECT_EQ(current.positions[j], last.positions[i]);
  }
}

TEST(TemporaryPoints, NeedAPose) {
  TrackedFrame last = frame_with_depths(10, 10);
  last.T_cw.reset();
  PointBatch points;
  EXPECT_THROW(add_temporary_points(last, points), StateError);
}

}  // namespace
}  // namespace orbslam::testing
