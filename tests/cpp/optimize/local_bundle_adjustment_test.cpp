// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/local_bundle_adjustment.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <thread>
#include <tuple>

#include "map/invariants.hpp"
#include "optimize/bundle_gather.hpp"
#include "support/synthetic_frames.hpp"

namespace orbslam {
namespace {

using testing::make_point_cloud;
using testing::PointCloud;
using testing::project_cloud;
using testing::ProjectedFrame;
using testing::ProjectionOptions;

/// Keyframes in a row that see one cloud; poses (but the first) and points are disturbed.
class Street {
 public:
  Map map;
  std::vector<MapPointId> points;  ///< per point of the cloud; keyframe 0 sees them all
  std::vector<Pose> truth;
  PointCloud cloud;

  explicit Street(int n_keyframes, bool with_depth = true, double bf = 40)
      : cloud(make_point_cloud(300, 2, 4, 9, 1)) {
    std::mt19937_64 random(2);
    for (int k = 0; k < n_keyframes; ++k) {
      const Pose T_cw(Eigen::Quaterniond::Identity(), Eigen::Vector3d(-0.2 * k, 0, 0));
      truth.push_back(T_cw);
      Vector6d xi;
      for (int i = 0; i < 6; ++i) xi(i) = testing::uniform(random, -0.01, 0.01);
      ProjectionOptions options;
      options.with_depth = with_depth;
      options.pixel_noise = 0.3;
      options.seed = static_cast<std::uint64_t>(k);
      const ProjectedFrame seen =
          project_cloud(k, cloud, T_cw, options, testing::synthetic_camera(bf));
      const KeyFrameId id = map.add_keyframe(seen.frame, k == 0 ? T_cw : Pose::exp(xi) * T_cw);
      if (k == 0) add_points(random);
      for (std::size_t i = 0; i < seen.points.size(); ++i) {
        map.add_observation(points[seen.points[i]], id, i);
      }
      map.publish(id);
    }
    for (int k = 0; k < n_keyframes; ++k) map.update_connections(KeyFrameId(k));
    for (const MapPointId id : points) map.update_point(id);
  }

  void add_points(std::mt19937_64& random) {
    for (const Eigen::Vector3d& position : cloud.positions) {
      const Eigen::Vector3d wrong(testing::uniform(random, -0.05, 0.05),
                                  testing::uniform(random, -0.05, 0.05),
                                  testing::uniform(random, -0.05, 0.05));
      points.push_back(map.add_point(position + wrong, KeyFrameId(0), 0));
    }
  }

  double position_error() const {
    double sum = 0;
    int n = 0;
    map.for_each_keyframe([&](const KeyFrame& keyframe) {
      const auto k = static_cast<std::size_t>(keyframe.id.value);
      sum += (keyframe.center() - truth[k].center()).squaredNorm();
      ++n;
    });
    return std::sqrt(sum / n);
  }
  std::string violations() const {
    std::string text;
    for (const std::string& violation : check_invariants(map, false)) text += violation + "\n";
    return text;
  }
  std::vector<double> numbers() const {
    std::vector<double> all;
    map.for_each_keyframe([&](const KeyFrame& keyframe) {
      const Eigen::Matrix4d m = keyframe.T_cw.matrix();
      all.insert(all.end(), m.data(), m.data() + 16);
    });
    map.for_each_point([&](const MapPoint& point) {
      all.insert(all.end(), point.position.data(), point.position.data() + 3);
    });
    return all;
  }
};

TEST(LocalBundleAdjustment, RefinesPosesAndPoints) {
  Street street(6);
  const double before = street.position_error();
  const LocalBundleResult result =
      local_bundle_adjustment(street.map, KeyFrameId(5), nullptr, false, 1);
  EXPECT_TRUE(result.committed);
  EXPECT_TRUE(result.summary.stage_one_done);
  EXPECT_EQ(result.n_local_keyframes, 6);
  EXPECT_EQ(result.n_fixed_keyframes, 1);
  EXPECT_EQ(result.n_points, 300);
  EXPECT_LT(street.position_error(), 0.3 * before);  // the rest is pixel noise
  EXPECT_EQ(street.map.find(KeyFrameId(0))->T_cw.matrix(), street.truth[0].matrix());
  EXPECT_EQ(street.violations(), "");
}

TEST(LocalBundleAdjustment, ErasesWrongObservationsOnBothSides) {
  Street street(6);
  // Two points trade their positions in the eyes of keyframe 3: both observations are wrong.
  const KeyFrame& keyframe = *street.map.find(KeyFrameId(3));
  const MapPointId a = keyframe.map_points[10], b = keyframe.map_points[50];
  street.map.erase_observation(a, KeyFrameId(3));
  street.map.erase_observation(b, KeyFrameId(3));
  street.map.add_observation(a, KeyFrameId(3), 50);
  street.map.add_observation(b, KeyFrameId(3), 10);
  const LocalBundleResult result = local_bundle_adjustment(street.map, KeyFrameId(5), nullptr);
  EXPECT_GE(result.n_erased, 2);
  EXPECT_LT(result.n_erased, 20);
  EXPECT_EQ(street.map.find(a)->observation_of(KeyFrameId(3)), nullptr);
  EXPECT_EQ(street.map.find(b)->observation_of(KeyFrameId(3)), nullptr);
  EXPECT_FALSE(keyframe.map_points[10].valid());
  EXPECT_FALSE(keyframe.map_points[50].valid());
  EXPECT_EQ(street.violations(), "");
}

TEST(LocalBundleAdjustment, RefreshesTheGeometryOfPoints) {
  Street street(5);
  local_bundle_adjustment(street.map, KeyFrameId(4), nullptr);
  for (const MapPointId id : street.points) {
    const MapPoint* point = street.map.find(id);
    if (point == nullptr) continue;
    const Eigen::Vector3d direction = point->mean_direction;
    const double max_distance = point->max_distance;
    street.map.update_geometry(id);
    EXPECT_EQ(point->mean_direction, direction);
    EXPECT_EQ(point->max_distance, max_distance);
  }
}

TEST(LocalBundleAdjustment, OuterKeyframesStay) {
  // A keyframe that shares few points with the others observes without being a neighbour.
  Street street(6);
  const KeyFrameId last(5);
  const std::vector<MapPointId> slots = street.map.find(last)->map_points;
  int kept = 0;
  for (const MapPointId id : slots) {
    if (id.valid() && ++kept > 10) street.map.erase_observation(id, last);
  }
  for (int k = 0; k < 6; ++k) street.map.update_connections(KeyFrameId(k));
  const auto neighbours = street.map.find(KeyFrameId(4))->neighbours;
  ASSERT_EQ(std::count(neighbours.begin(), neighbours.end(), last), 0);
  const Pose before = street.map.find(last)->T_cw;
  const LocalBundleResult result = local_bundle_adjustment(street.map, KeyFrameId(4), nullptr);
  EXPECT_EQ(result.n_local_keyframes, 5);
  EXPECT_EQ(result.n_fixed_keyframes, 2);
  EXPECT_EQ(street.map.find(last)->T_cw.matrix(), before.matrix());
}

double distance_from_first(const Map& map) {
  double sum = 0;
  const Eigen::Vector3d first = map.find(KeyFrameId(0))->center();
  map.for_each_keyframe(
      [&](const KeyFrame& keyframe) { sum += (keyframe.center() - first).norm(); });
  return sum;
}

// OD-112: with one fixed pose the scale is free.
TEST(LocalBundleAdjustment, SingleCameraKeepsTheScale) {
  Street street(5, false, 0);
  const double before = distance_from_first(street.map);
  const LocalBundleResult result =
      local_bundle_adjustment(street.map, KeyFrameId(4), nullptr, true, 1);
  EXPECT_TRUE(result.committed);
  EXPECT_NEAR(distance_from_first(street.map), before, 1e-9 * before);
}

TEST(LocalBundleAdjustment, SingleCameraIsNotHeldToWhatWasKnownOfTheSecondPoseAtFirst) {
  for (const int n : {2, 5}) {
    Street street(n, false, 0);
    const Eigen::Quaterniond wrong = street.map.find(KeyFrameId(1))->T_cw.rotation();
    const LocalBundleResult result =
        local_bundle_adjustment(street.map, KeyFrameId(n - 1), nullptr, true, 1);
    EXPECT_EQ(result.n_fixed_keyframes, 1);
    const Pose& second = street.map.find(KeyFrameId(1))->T_cw;
    EXPECT_LT(second.rotation().angularDistance(street.truth[1].rotation()),
              0.3 * wrong.angularDistance(street.truth[1].rotation()));
    // The points went along: they are still seen where the keypoints are.
    EXPECT_LT(result.summary.final_cost, 0.1 * result.summary.initial_cost);
    const LocalBundleResult again =
        local_bundle_adjustment(street.map, KeyFrameId(n - 1), nullptr, true, 1);
    EXPECT_NEAR(again.summary.initial_cost, result.summary.final_cost,
                0.01 * result.summary.final_cost);
  }
}

TEST(LocalBundleAdjustment, RaisedFlagChangesNothing) {
  Street street(5);
  const std::vector<double> before = street.numbers();
  const std::atomic<bool> abort{true};
  const LocalBundleResult result = local_bundle_adjustment(street.map, KeyFrameId(4), &abort);
  EXPECT_FALSE(result.committed);
  EXPECT_TRUE(result.summary.aborted);
  EXPECT_EQ(street.numbers(), before);
}

// OD-93: an interrupted adjustment does not judge by what it has reached.
TEST(LocalBundleAdjustment, FlagDuringTheWorkErasesNothingBeforeTheFirstStageIsDone) {
  for (int delay = 0; delay < 10; ++delay) {
    Street street(6);
    const std::vector<double> before = street.numbers();
    std::atomic<bool> abort{false};
    std::thread other([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(delay));
      abort = true;
    });
    const LocalBundleResult result = local_bundle_adjustment(street.map, KeyFrameId(5), &abort);
    other.join();
    if (!result.summary.stage_one_done) {
      EXPECT_EQ(result.n_erased, 0);
    }
    EXPECT_LE(result.summary.final_cost, result.summary.initial_cost);
    EXPECT_EQ(result.committed, street.numbers() != before);
    EXPECT_EQ(street.violations(), "");
  }
}

TEST(LocalBundleAdjustment, UnknownOrDeadKeyframeGivesAnEmptyResult) {
  Street street(4);
  const std::vector<double> before = street.numbers();
  EXPECT_FALSE(local_bundle_adjustment(street.map, KeyFrameId(99), nullptr).committed);
  EXPECT_FALSE(local_bundle_adjustment(street.map, KeyFrameId(), nullptr).committed);
  EXPECT_EQ(street.numbers(), before);
  street.map.erase_keyframe(KeyFrameId(2));
  EXPECT_FALSE(local_bundle_adjustment(street.map, KeyFrameId(2), nullptr).committed);
  Map empty;
  EXPECT_FALSE(local_bundle_adjustment(empty, KeyFrameId(0), nullptr).committed);
}

TEST(LocalBundleAdjustment, ResetDuringTheWorkDropsTheResult) {
  for (int delay = 0; delay < 10; ++delay) {
    Street street(6);
    std::thread other([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(delay));
      const auto lock = street.map.write_lock();
      street.map.clear();
      // The ids restart: a late commit would find a keyframe and move it.
      street.map.add_keyframe(testing::make_raster_frame(0, 10), Pose());
      street.map.add_keyframe(testing::make_raster_frame(1, 10), Pose());
    });
    local_bundle_adjustment(street.map, KeyFrameId(5), nullptr);
    other.join();
    EXPECT_EQ(street.map.find(KeyFrameId(1))->T_cw.matrix(), Pose().matrix());
  }
}

TEST(LocalBundleAdjustment, RepeatsBitByBit) {
  Street a(6), b(6);
  local_bundle_adjustment(a.map, KeyFrameId(5), nullptr);
  local_bundle_adjustment(b.map, KeyFrameId(5), nullptr);
  EXPECT_EQ(a.numbers(), b.numbers());
}

TEST(GatheredBundle, ManyPointsAreAddedAsEachAlone) {
  Street street(6);
  GatheredBundle together(street.map), alone(street.map);
  for (const int k : {4, 2, 5}) {  // in any order, and with gaps
    together.add_camera(*street.map.find(KeyFrameId(k)), false);
    alone.add_camera(*street.map.find(KeyFrameId(k)), false);
  }
  std::vector<const MapPoint*> points;
  for (const MapPointId id : street.points) points.push_back(street.map.find(id));
  together.add_points(points, street.map);
  for (const MapPoint* point : points) alone.add_point(*point, street.map);
  EXPECT_EQ(together.points, alone.points);
  EXPECT_EQ(together.keypoints, alone.keypoints);
  ASSERT_EQ(together.problem.observations.size(), alone.problem.observations.size());
  ASSERT_GT(alone.problem.observations.size(), points.size());
  for (std::size_t i = 0; i < alone.problem.observations.size(); ++i) {
    const auto &a = together.problem.observations[i], &b = alone.problem.observations[i];
    EXPECT_EQ(std::tie(a.camera, a.point, a.u, a.v, a.right_u, a.inverse_sigma2, a.has_depth),
              std::tie(b.camera, b.point, b.u, b.v, b.right_u, b.inverse_sigma2, b.has_depth));
  }
}

TEST(GatheredBundle, CommitSkipsWhatHasDiedMeanwhile) {
  Street street(5);
  GatheredBundle bundle(street.map);
  for (int k = 0; k < 5; ++k) bundle.add_camera(*street.map.find(KeyFrameId(k)), k == 0);
  for (const MapPointId id : street.points) bundle.add_point(*street.map.find(id), street.map);
  ASSERT_EQ(bundle.problem.points.size(), 300u);

  street.map.erase_keyframe(KeyFrameId(2));
  street.map.erase_point(street.points[7]);
  for (auto& point : bundle.problem.points) point.z() += 1;
  // Everything of keyframes 2 and 3 is to go.
  std::vector<std::uint8_t> flags;
  int n_of_third = 0;
  for (const auto& o : bundle.problem.observations) {
    flags.push_back(o.camera == 2 || o.camera == 3 ? 1 : 0);
    n_of_third += o.camera == 3 && o.point != 7 ? 1 : 0;
  }
  EXPECT_EQ(erase_observations(bundle, flags, street.map), n_of_third);
  write_back(bundle, street.map);
  EXPECT_EQ(street.map.find(street.points[7]), nullptr);
  EXPECT_EQ(street.map.find(street.points[8])->position, bundle.problem.points[8]);
  EXPECT_EQ(street.violations(), "");
}

}  // namespace
}  // namespace orbslam
