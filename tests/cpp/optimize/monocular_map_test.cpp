// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/monocular_map.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/errors.hpp"
#include "map/content_hash.hpp"
#include "map/culling.hpp"
#include "map/invariants.hpp"
#include "map/keyframe_insertion.hpp"
#include "map/scene_depth.hpp"
#include "support/synthetic_frames.hpp"

namespace orbslam::testing {
namespace {

using ::testing::IsEmpty;

/// Two views of one cloud by a single camera, and what a two-view reconstruction says of them:
/// right up to noise, in units of the baseline.
struct TwoViews {
  static constexpr double kBaseline = 0.5;

  PointCloud cloud;
  Pose truth;  ///< T_21 in the cloud's units
  std::vector<std::size_t> seen_first, seen_second;
  std::unique_ptr<TrackedFrame> initial, current;
  std::vector<int> matches;
  std::vector<Eigen::Vector3d> points;
  Pose T_21;

  explicit TwoViews(std::size_t n = 300, double noise = 0.02, std::int32_t level = 2)
      : cloud(make_point_cloud(n, 1.5, 4, 9, 1)),
        truth(Eigen::Quaterniond(Eigen::AngleAxisd(0.03, Eigen::Vector3d::UnitY())),
              kBaseline * Eigen::Vector3d(-0.96, 0, 0.28)) {
    ProjectionOptions options;
    options.with_depth = false;
    options.level = level;
    ProjectedFrame first = project_cloud(3, cloud, Pose(), options, synthetic_camera(0));
    ProjectedFrame second = project_cloud(8, cloud, truth, options, synthetic_camera(0));
    for (const auto* projected : {&first, &second}) projected->frame->described = true;
    seen_first = first.points;
    seen_second = second.points;
    initial = std::make_unique<TrackedFrame>(first.frame);
    current = std::make_unique<TrackedFrame>(second.frame);
    reconstruct(noise);
  }

  void reconstruct(double noise) {
    std::mt19937_64 random(2);
    for (const std::size_t point : seen_first) {
      const auto partner = std::lower_bound(seen_second.begin(), seen_second.end(), point);
      const bool matched = partner != seen_second.end() && *partner == point;
      matches.push_back(matched ? static_cast<int>(partner - seen_second.begin()) : -1);
      Eigen::Vector3d X = cloud.positions[point] / kBaseline;
      for (int i = 0; i < 3; ++i) X[i] *= 1 + uniform(random, -noise, noise);
      points.push_back(X);
    }
    Vector6d xi = Vector6d::Constant(noise / 10);
    const Pose disturbed = Pose::exp(xi) * truth;
    T_21 = Pose(disturbed.rotation(), disturbed.translation().normalized());
  }

  MonocularMap create(Map& map, std::size_t min_points = 100) {
    return create_monocular_map(map, *initial, *current, T_21, matches, points, min_points);
  }
  int n_matches() const {
    return static_cast<int>(
        std::count_if(matches.begin(), matches.end(), [](int match) { return match >= 0; }));
  }
};

TEST(CreateMonocularMap, FindsTheSceneAndScalesItToMedianDepthOne) {
  TwoViews views;
  Map map;
  const MonocularMap made = views.create(map);
  ASSERT_TRUE(made.ok);
  EXPECT_EQ(made.failure, MonocularMapFailure::kNone);
  EXPECT_EQ(made.first, KeyFrameId(0));
  EXPECT_EQ(made.second, KeyFrameId(1));
  EXPECT_EQ(made.n_points, views.n_matches());
  EXPECT_EQ(map.n_points(), static_cast<std::size_t>(views.n_matches()));
  EXPECT_EQ(map.n_keyframes(), 2U);
  EXPECT_LT(made.summary.final_cost, made.summary.initial_cost);
  EXPECT_LT(made.summary.final_cost, 1e-4 * made.n_points);  // there is no pixel noise
  EXPECT_THAT(check_invariants(map, true), IsEmpty());

  const KeyFrame& first = *map.find(made.first);
  const KeyFrame& second = *map.find(made.second);
  EXPECT_EQ(first.T_cw.matrix(), Pose().matrix());
  EXPECT_NEAR(*median_scene_depth(map, first), 1.0, 1e-6);
  EXPECT_LT((second.T_cw.rotation_matrix() - views.truth.rotation_matrix()).norm(), 1e-4);

  // One factor takes the cloud to the map: baseline and points are scaled alike.
  const double factor = second.T_cw.translation().norm() / TwoViews::kBaseline;
  EXPECT_LT((second.T_cw.translation() - factor * views.truth.translation()).norm(), 1e-4);
  for (std::size_t i = 0; i < views.matches.size(); ++i) {
    const MapPoint* point = map.find(first.map_points[i]);
    ASSERT_EQ(point != nullptr, views.matches[i] >= 0);
    if (point == nullptr) continue;
    const Eigen::Vector3d expected = factor * views.cloud.positions[views.seen_first[i]];
    EXPECT_LT((point->position - expected).norm(), 2e-3 * expected.norm());
    EXPECT_EQ(second.map_points[static_cast<std::size_t>(views.matches[i])], point->id);
  }
}

TEST(CreateMonocularMap, TellsTheMedianBeforeScaling) {
  TwoViews views;
  Map map;
  const MonocularMap made = views.create(map);
  ASSERT_TRUE(made.ok);
  // The adjustment keeps about the scale of its start, so the factor between the units follows.
  const double length = map.find(made.second)->T_cw.translation().norm();
  EXPECT_NEAR(length * made.median_depth, 1.0, 0.05);
  std::vector<double> depths;
  for (std::size_t i = 0; i < views.matches.size(); ++i) {
    if (views.matches[i] >= 0) depths.push_back(views.cloud.positions[views.seen_first[i]].z());
  }
  std::sort(depths.begin(), depths.end());
  const double median = depths[(depths.size() - 1) / 2];
  EXPECT_NEAR(length, TwoViews::kBaseline / median, 1e-3 * length);
}

// OD-62: scale ranges and directions follow the scaled positions.
TEST(CreateMonocularMap, PointsAreReadyForTheFirstFrames) {
  TwoViews views;
  Map map;
  const MonocularMap made = views.create(map);
  ASSERT_TRUE(made.ok);
  const Eigen::Vector3d center = map.find(made.second)->center();
  map.for_each_point([&](const MapPoint& point) {
    EXPECT_EQ(point.observations.size(), 2U);
    EXPECT_EQ(point.observation_count, 2);
    EXPECT_EQ(point.reference_keyframe, made.second);
    EXPECT_EQ(point.first_keyframe, made.second);
    EXPECT_EQ(point.first_frame, 8);
    const double distance = (point.position - center).norm();
    EXPECT_NEAR(point.max_distance, distance * 1.44, 1e-6);  // all keypoints are on level 2
    EXPECT_NEAR(point.max_distance / point.min_distance, std::pow(1.2, 7), 1e-5);
    const Eigen::Vector3d mean =
        (point.position.normalized() + (point.position - center).normalized()) / 2;
    EXPECT_LT((point.mean_direction - mean).norm(), 1e-12);
    const auto slot = static_cast<std::size_t>(point.observation_of(made.first)->index);
    EXPECT_EQ(point.descriptor.words, views.initial->frame->descriptors[slot].words);
  });
  EXPECT_EQ(map.weight(made.first, made.second), made.n_points);
  EXPECT_EQ(map.find(made.second)->parent, made.first);
}

TEST(CreateMonocularMap, FramesTakeOverTheResult) {
  TwoViews views;
  Map map;
  views.current->associate(0, MapPointId(77), {1, 1, 1});  // old associations go
  const MonocularMap made = views.create(map);
  ASSERT_TRUE(made.ok);
  for (const auto& [frame, id] :
       {std::pair{views.initial.get(), made.first}, std::pair{views.current.get(), made.second}}) {
    const KeyFrame& keyframe = *map.find(id);
    EXPECT_EQ(frame->T_cw->matrix(), keyframe.T_cw.matrix());
    EXPECT_EQ(frame->reference_keyframe(), id);
    EXPECT_EQ(frame->map_points, keyframe.map_points);
    for (std::size_t i = 0; i < frame->map_points.size(); ++i) {
      const MapPoint* point = map.find(frame->map_points[i]);
      if (point != nullptr) {
        EXPECT_EQ(frame->positions[i], point->position);
      }
      EXPECT_EQ(frame->outlier[i], 0);
    }
  }
}

TEST(CreateMonocularMap, LocalMappingTakesBothKeyframes) {
  TwoViews views;
  Map map;
  const MonocularMap made = views.create(map);
  ASSERT_TRUE(made.ok);
  std::vector<MapPointId> recent;
  process_new_keyframe(map, made.first, recent);
  EXPECT_THAT(recent, IsEmpty());
  process_new_keyframe(map, made.second, recent);
  std::vector<MapPointId> once = map.point_ids();
  std::sort(recent.begin(), recent.end());
  EXPECT_EQ(recent, once);
  EXPECT_THROW(process_new_keyframe(map, made.second, recent), StateError);
  EXPECT_EQ(cull_recent_points(map, made.second, 2, recent), 0);
  EXPECT_EQ(map.n_keyframes(), 2U);
  EXPECT_THAT(check_invariants(map, true), IsEmpty());
}

TEST(CreateMonocularMap, FewPointsFail) {
  TwoViews views;
  Map map;
  const auto n = static_cast<std::size_t>(views.n_matches());
  const MonocularMap made = views.create(map, n + 1);
  EXPECT_FALSE(made.ok);
  EXPECT_EQ(made.failure, MonocularMapFailure::kFewPoints);
  EXPECT_EQ(made.n_points, static_cast<int>(n));
  EXPECT_EQ(map.n_keyframes(), 0U);
  EXPECT_FALSE(views.current->T_cw.has_value());
  EXPECT_EQ(views.current->n_associated(), 0U);
  map.clear();
  EXPECT_TRUE(views.create(map, n).ok);
}

// OD-63: without points there is no median depth to divide by.
TEST(CreateMonocularMap, NoPointsFailEvenWithoutAMinimum) {
  TwoViews views;
  std::fill(views.matches.begin(), views.matches.end(), -1);
  Map map;
  const MonocularMap made = views.create(map, 0);
  EXPECT_EQ(made.failure, MonocularMapFailure::kFewPoints);
  EXPECT_TRUE(std::isnan(made.median_depth));
}

TEST(CreateMonocularMap, PointsThatAreNotFiniteAreLeftOut) {
  TwoViews views;
  const auto matched = std::find_if(views.matches.begin(), views.matches.end(),
                                    [](int match) { return match >= 0; });
  views.points[static_cast<std::size_t>(matched - views.matches.begin())].z() = std::nan("");
  Map map;
  const MonocularMap made = views.create(map);
  EXPECT_TRUE(made.ok);
  EXPECT_EQ(made.n_points, views.n_matches() - 1);
}

TEST(CreateMonocularMap, PointsBehindTheCameraFail) {
  TwoViews views;
  for (Eigen::Vector3d& point : views.points) point.z() = -point.z();
  Map map;
  const MonocularMap made = views.create(map);
  EXPECT_EQ(made.failure, MonocularMapFailure::kBadDepth);
  EXPECT_LT(made.median_depth, 0);
  EXPECT_EQ(map.n_keyframes(), 0U);
}

TEST(CreateMonocularMap, RefusesWhatDoesNotFit) {
  Map map;
  TwoViews doubled;
  const auto first = std::find_if(doubled.matches.begin(), doubled.matches.end(),
                                  [](int match) { return match >= 0; });
  *std::find_if(first + 1, doubled.matches.end(), [](int match) { return match >= 0; }) = *first;
  EXPECT_THROW(doubled.create(map), StateError);
  TwoViews out_of_range;
  out_of_range.matches[0] = static_cast<int>(out_of_range.current->frame->size());
  EXPECT_THROW(out_of_range.create(map), StateError);
  TwoViews too_short;
  too_short.points.pop_back();
  EXPECT_THROW(too_short.create(map), StateError);
  TwoViews wordless;
  std::const_pointer_cast<Frame>(wordless.current->frame)->described = false;
  EXPECT_THROW(wordless.create(map), StateError);
  EXPECT_THAT(map.keyframe_ids(), IsEmpty());  // all found before anything was made

  TwoViews views;
  ASSERT_TRUE(views.create(map).ok);
  EXPECT_THROW(views.create(map), StateError);
}

TEST(CreateMonocularMap, RepeatsBitByBit) {
  Map a, b;
  ASSERT_TRUE(TwoViews().create(a).ok);
  ASSERT_TRUE(TwoViews().create(b).ok);
  EXPECT_EQ(content_hash(a), content_hash(b));
}

}  // namespace
}  // namespace orbslam::testing
