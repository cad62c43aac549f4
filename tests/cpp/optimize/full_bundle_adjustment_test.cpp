// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/full_bundle_adjustment.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "map/content_hash.hpp"
#include "map/invariants.hpp"
#include "optimize/full_bundle.hpp"
#include "support/synthetic_frames.hpp"

namespace orbslam::testing {
namespace {

using ::testing::IsEmpty;

/// Stereo keyframes in a row above one cloud; poses (but the first) and points are disturbed. The
/// last keyframe is not published.
class Row {
 public:
  Map map;
  PointCloud cloud;
  std::vector<Pose> truth;
  std::vector<MapPointId> points;

  explicit Row(int n_keyframes, double step = 0.2, std::size_t n_points = 300)
      : cloud(make_point_cloud(n_points, 2, 4, 9, 1)) {
    std::mt19937_64 random(2);
    for (int k = 0; k < n_keyframes; ++k) {
      const Pose T_cw(Eigen::Quaterniond::Identity(), Eigen::Vector3d(-step * k, 0, 0));
      truth.push_back(T_cw);
      Vector6d xi;
      for (int i = 0; i < 6; ++i) xi(i) = uniform(random, -0.01, 0.01);
      const ProjectedFrame seen = project_cloud(k, cloud, T_cw);
      const KeyFrameId id = map.add_keyframe(seen.frame, k == 0 ? T_cw : Pose::exp(xi) * T_cw);
      observe(id, seen.points, random);
      if (k + 1 < n_keyframes) map.publish(id);
    }
    for (int k = 0; k < n_keyframes; ++k) map.update_connections(KeyFrameId(k));
    for (const MapPointId id : points) map.update_point(id);
  }

  void observe(KeyFrameId id, const std::vector<std::size_t>& seen, std::mt19937_64& random) {
    points.resize(cloud.positions.size());
    for (std::size_t i = 0; i < seen.size(); ++i) {
      MapPointId& point = points[seen[i]];
      if (!point.valid()) {
        const Eigen::Vector3d wrong(uniform(random, -0.05, 0.05), uniform(random, -0.05, 0.05),
                                    uniform(random, -0.05, 0.05));
        point = map.add_point(cloud.positions[seen[i]] + wrong, id, 0);
      }
      map.add_observation(point, id, i);
    }
  }

  double largest_error() const {
    double largest = 0;
    map.for_each_keyframe([&](const KeyFrame& keyframe) {
      const auto k = static_cast<std::size_t>(keyframe.id.value);
      largest = std::max(largest, (keyframe.center() - truth[k].center()).norm());
    });
    return largest;
  }
};

TEST(FullBundleAdjustment, RefinesAllKeyframesAndPoints) {
  Row row(6);
  ASSERT_EQ(row.map.n_keyframes(), 5U);
  const auto big_changes = row.map.big_change_index();
  const std::size_t n_points = row.map.n_points();
  const FullBundleResult result = full_bundle_adjustment(row.map, {}, nullptr);
  EXPECT_TRUE(result.committed);
  EXPECT_EQ(result.n_keyframes, 6);
  EXPECT_EQ(result.n_points, static_cast<int>(n_points));
  EXPECT_GT(result.n_observations, 6 * 100);
  EXPECT_LT(result.summary.final_cost, 1e-3 * result.summary.initial_cost);
  EXPECT_LE(result.summary.iterations, 10);
  EXPECT_EQ(row.map.find(KeyFrameId(0))->T_cw.matrix(), row.truth[0].matrix());
  EXPECT_LT(row.largest_error(), 1e-3);
  EXPECT_EQ(row.map.n_points(), n_points);
  EXPECT_EQ(row.map.big_change_index(), big_changes + 1);
  EXPECT_THAT(check_invariants(row.map, false), IsEmpty());
  for (std::size_t i = 0; i < row.points.size(); ++i) {
    const MapPoint* point = row.map.find(row.points[i]);
    if (point == nullptr) continue;
    EXPECT_LT((point->position - row.cloud.positions[i]).norm(), 1e-2);
    const double limit = point->max_distance;
    row.map.update_geometry(point->id);
    EXPECT_EQ(point->max_distance, limit);
  }
}

TEST(FullBundleAdjustment, ManyKeyframesTakeTheSparseSolver) {
  Row row(40, 0.05, 150);
  const FullBundleResult result = full_bundle_adjustment(row.map, {10, false}, nullptr);
  EXPECT_TRUE(result.committed);
  EXPECT_EQ(result.n_keyframes, 40);
  EXPECT_LT(row.largest_error(), 1e-3);
}

TEST(FullBundleAdjustment, KernelLimitsTheInfluenceOfAWrongObservation) {
  double errors[2];
  for (const bool robust : {false, true}) {
    Row row(4);
    // Two points trade their keypoints in keyframe 2.
    const auto slots = row.map.find(KeyFrameId(2))->map_points;
    const MapPointId a = slots[10], b = slots[50];
    row.map.erase_observation(a, KeyFrameId(2));
    row.map.erase_observation(b, KeyFrameId(2));
    row.map.add_observation(a, KeyFrameId(2), 50);
    row.map.add_observation(b, KeyFrameId(2), 10);
    const std::size_t n_before = row.map.find(a)->observations.size();
    ASSERT_TRUE(full_bundle_adjustment(row.map, {20, robust}, nullptr).committed);
    errors[robust ? 1 : 0] = row.largest_error();
    EXPECT_EQ(row.map.find(a)->observations.size(), n_before);  // nothing is erased
  }
  EXPECT_LT(errors[1], 0.2 * errors[0]);
}

TEST(FullBundleAdjustment, StopsAfterTheGivenIterations) {
  Row row(6);
  EXPECT_EQ(full_bundle_adjustment(row.map, {1, true}, nullptr).summary.iterations, 1);
}

TEST(FullBundleAdjustment, AbortKeepsTheMapAsItWas) {
  Row raised(5);
  const std::uint64_t before = content_hash(raised.map);
  const std::atomic<bool> abort{true};
  const FullBundleResult result = full_bundle_adjustment(raised.map, {}, &abort);
  EXPECT_TRUE(result.summary.aborted);
  EXPECT_FALSE(result.committed);
  EXPECT_EQ(content_hash(raised.map), before);

  for (int delay = 0; delay < 10; ++delay) {
    Row row(12);
    std::atomic<bool> later{false};
    std::thread other([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(delay));
      later = true;
    });
    const std::uint64_t hash = content_hash(row.map);
    const FullBundleResult interrupted = full_bundle_adjustment(row.map, {}, &later);
    other.join();
    EXPECT_EQ(interrupted.committed, !interrupted.summary.aborted);
    EXPECT_EQ(interrupted.committed, content_hash(row.map) != hash);
  }
}

TEST(FullBundleAdjustment, ResetDuringTheWorkDropsTheResult) {
  for (int delay = 0; delay < 10; ++delay) {
    Row row(8);
    std::thread other([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(delay));
      const auto lock = row.map.write_lock();
      row.map.clear();
      row.map.add_keyframe(make_raster_frame(0, 10), Pose());
      row.map.add_keyframe(make_raster_frame(1, 10), Pose());
    });
    full_bundle_adjustment(row.map, {}, nullptr);
    other.join();
    EXPECT_EQ(row.map.find(KeyFrameId(1))->T_cw.matrix(), Pose().matrix());
  }
}

TEST(FullBundleAdjustment, KeyframesThatNoPointTiesToTheOthersFollow) {
  Row row(4);
  const KeyFrameId blind =
      row.map.add_keyframe(make_raster_frame(9, 10), Pose::exp(Vector6d::Constant(0.3)));
  const KeyFrameId own = row.map.add_keyframe(make_raster_frame(10, 10, 3), Pose());
  const MapPointId point = row.map.add_point({0, 0, 3}, own, 10);
  row.map.add_observation(point, own, 0);
  const KeyFrame& before = *row.map.find(KeyFrameId(3));
  const Pose T_blind = row.map.find(blind)->T_cw * before.T_cw.inverse();
  const Pose T_own = row.map.find(own)->T_cw * row.map.find(blind)->T_cw.inverse();
  const Eigen::Vector3d p_own = row.map.find(own)->T_cw * row.map.find(point)->position;

  const GatheredBundle bundle = gather_full_bundle(row.map);
  EXPECT_EQ(bundle.n_fixed(), 1);
  EXPECT_EQ(bundle.keyframes.size(), 4U);
  EXPECT_EQ(bundle.camera_of.count(blind) + bundle.camera_of.count(own), 0U);
  EXPECT_EQ(bundle.points.back().value + 1, point.value);
  ASSERT_TRUE(full_bundle_adjustment(row.map, {}, nullptr).committed);
  const auto& map = row.map;
  EXPECT_TRUE((T_blind * before.T_cw).matrix().isApprox(map.find(blind)->T_cw.matrix(), 1e-12));
  EXPECT_TRUE(
      (T_own * map.find(blind)->T_cw).matrix().isApprox(map.find(own)->T_cw.matrix(), 1e-12));
  EXPECT_TRUE((map.find(own)->T_cw * map.find(point)->position).isApprox(p_own, 1e-12));
}

TEST(FullBundleAdjustment, EmptyMapIsLeftAlone) {
  Map map;
  const FullBundleResult result = full_bundle_adjustment(map, {}, nullptr);
  EXPECT_FALSE(result.committed);
  EXPECT_EQ(result.n_keyframes, 0);
  EXPECT_EQ(result.n_points, 0);
}

TEST(FullBundleAdjustment, RepeatsBitByBit) {
  Row a(6), b(6);
  full_bundle_adjustment(a.map, {}, nullptr);
  full_bundle_adjustment(b.map, {}, nullptr);
  EXPECT_EQ(content_hash(a.map), content_hash(b.map));
}

}  // namespace
}  // namespace orbslam::testing
