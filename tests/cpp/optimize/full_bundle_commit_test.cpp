// SPDX-License-Identifier: BSD-3-Clause
// A full bundle adjustment while the map changes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <thread>

#include "map/content_hash.hpp"
#include "map/invariants.hpp"
#include "optimize/full_bundle.hpp"
#include "optimize/full_bundle_adjustment.hpp"
#include "optimize/local_bundle_adjustment.hpp"
#include "support/loop_map.hpp"

namespace orbslam::testing {
namespace {

using ::testing::IsEmpty;

LoopMapOptions small_loop() {
  LoopMapOptions options;
  options.n_keyframes = 60;
  options.points_per_keyframe = 40;
  options.overlap = 0.1;
  options.outliers = 0.01;
  return options;
}

/// Robustified cost of a map, as full bundle adjustment sees it.
double cost_of(const Map& map) {
  GatheredBundle bundle = gather_full_bundle(map);
  const std::atomic<bool> abort{true};
  return solve_full_bundle(bundle, {}, &abort, 1).initial_cost;
}

KeyFrameId kf(std::int64_t value) { return KeyFrameId(value); }

class FullBundleCommitting : public ::testing::Test {
 protected:
  LoopMap loop{small_loop()};
  Map& map = loop.map;
  GatheredBundle bundle = gather_full_bundle(map);
  const double cost_before = cost_of(map);

  void SetUp() override {
    const BundleSummary summary = solve_full_bundle(bundle, {}, nullptr, 1);
    ASSERT_TRUE(bundle.solved);
    ASSERT_LT(summary.final_cost, 0.95 * summary.initial_cost);
  }

  Pose relative(KeyFrameId a, KeyFrameId b) const {
    return map.find(a)->T_cw * map.find(b)->T_cw.inverse();
  }
  static void expect_equal(const Pose& a, const Pose& b) {
    EXPECT_TRUE(a.matrix().isApprox(b.matrix(), 1e-12)) << a.matrix() << "\n" << b.matrix();
  }
  const Pose& solved(KeyFrameId id) const {
    return bundle.problem.cameras[bundle.camera_of.at(id)].T_cw;
  }

  /// The bundle's keyframes and points that live are where the result says, and all else follows.
  void expect_committed(std::size_t n_dead_keyframes = 0) {
    std::size_t n_alive = 0;
    for (const KeyFrameId id : bundle.keyframes) {
      if (map.find(id) == nullptr) continue;
      ++n_alive;
      EXPECT_EQ(map.find(id)->T_cw.matrix(), solved(id).matrix());
    }
    EXPECT_EQ(n_alive + n_dead_keyframes, bundle.keyframes.size());
    for (std::size_t i = 0; i < bundle.points.size(); ++i) {
      const MapPoint* point = map.find(bundle.points[i]);
      if (point == nullptr) continue;
      EXPECT_EQ(point->position, bundle.problem.points[i]);
    }
    EXPECT_THAT(check_invariants(map, false), IsEmpty());
    for (const MapPointId id : map.point_ids()) {
      const MapPoint written = *map.find(id);
      map.update_geometry(id);
      const MapPoint& expected = *map.find(id);
      ASSERT_EQ(written.mean_direction, expected.mean_direction);
      ASSERT_EQ(written.max_distance, expected.max_distance);
      ASSERT_EQ(written.min_distance, expected.min_distance);
    }
  }
  void expect_not_committed() {
    const std::uint64_t before = content_hash(map);
    const std::uint64_t big_changes = map.big_change_index();
    EXPECT_FALSE(commit_full_bundle(map, bundle).committed);
    EXPECT_EQ(content_hash(map), before);
    EXPECT_EQ(map.big_change_index(), big_changes);
  }

  /// A keyframe that sees two of keyframe 59's points and a new one.
  KeyFrameId add_keyframe(bool publish) {
    const KeyFrameId id = map.add_keyframe(
        make_raster_frame(100, 40, 3),
        Pose::exp((Vector6d() << 0, 0.02, 0, 0, 0, -0.4).finished()) * map.find(kf(59))->T_cw);
    if (!publish) return id;
    std::size_t slot = 0;
    for (const MapPointId point : map.find(kf(59))->map_points) {
      if (point.valid() && slot < 30) map.add_observation(point, id, slot++);
    }
    map.update_connections(id);
    map.publish(id);
    return id;
  }
};

TEST_F(FullBundleCommitting, MovesTheMapInOneBigChange) {
  const std::uint64_t big_changes = map.big_change_index();
  const FullBundleCommit commit = commit_full_bundle(map, bundle);
  EXPECT_TRUE(commit.committed);
  EXPECT_EQ(commit.n_followed_keyframes, 0);
  EXPECT_EQ(commit.n_followed_points, 0);
  EXPECT_EQ(map.big_change_index(), big_changes + 1);
  expect_committed();
  EXPECT_LT(cost_of(map), cost_before);
}

TEST_F(FullBundleCommitting, ResultIsUsedOnce) {
  ASSERT_TRUE(commit_full_bundle(map, bundle).committed);
  expect_not_committed();
}

TEST_F(FullBundleCommitting, KeyframesAndPointsMadeMeanwhileFollow) {
  const KeyFrameId added = add_keyframe(true);
  const KeyFrameId parent = map.find(added)->parent;
  ASSERT_TRUE(parent.valid());
  const KeyFrameId below = map.add_keyframe(make_raster_frame(101, 10, 3), map.find(added)->T_cw);
  map.publish(below);
  map.set_parent(below, added);
  const MapPointId point =
      map.add_point(map.find(added)->T_cw.inverse() * Eigen::Vector3d(0.1, 0.2, 3), added, 100);
  map.add_observation(point, added, 35);
  map.update_point(point);
  const Pose T_added = relative(added, parent), T_below = relative(below, added);
  const Eigen::Vector3d p_added = map.find(added)->T_cw * map.find(point)->position;

  const FullBundleCommit commit = commit_full_bundle(map, bundle);
  EXPECT_TRUE(commit.committed);
  EXPECT_EQ(commit.n_followed_keyframes, 2);
  EXPECT_EQ(commit.n_followed_points, 1);
  expect_committed();
  EXPECT_GT((map.find(parent)->center() - loop.truth[0].center()).norm(), 0);
  expect_equal(relative(added, parent), T_added);
  expect_equal(relative(below, added), T_below);
  EXPECT_TRUE((map.find(added)->T_cw * map.find(point)->position).isApprox(p_added, 1e-12));
}

TEST_F(FullBundleCommitting, WhatIsNotPublishedFollowsTheKeyframeBeforeIt) {
  const KeyFrameId first = add_keyframe(false), second = add_keyframe(false);
  const Pose T_first = relative(first, kf(59)), T_second = relative(second, first);
  EXPECT_EQ(commit_full_bundle(map, bundle).n_followed_keyframes, 2);
  expect_committed();
  expect_equal(relative(first, kf(59)), T_first);
  expect_equal(relative(second, first), T_second);
}

TEST_F(FullBundleCommitting, TheDeadStayDead) {
  ASSERT_TRUE(map.erase_keyframe(kf(30)));
  const MapPointId erased = bundle.points[200];
  map.erase_point(erased);
  const KeyFrameId heir = map.living(kf(30));
  const Pose T_dead = map.T_cw(kf(30)) * map.find(heir)->T_cw.inverse();
  EXPECT_TRUE(commit_full_bundle(map, bundle).committed);
  expect_committed(1);
  EXPECT_EQ(map.find(kf(30)), nullptr);
  EXPECT_EQ(map.find(erased), nullptr);
  expect_equal(map.T_cw(kf(30)) * map.find(heir)->T_cw.inverse(), T_dead);
  EXPECT_LT(cost_of(map), cost_before);
}

TEST_F(FullBundleCommitting, ADeadParentDoesNotLoseTheKeyframeMadeMeanwhile) {
  const KeyFrameId added = add_keyframe(true);
  const KeyFrameId dying = map.find(added)->parent;
  ASSERT_TRUE(map.erase_keyframe(dying));
  const KeyFrameId parent = map.find(added)->parent;
  const Pose T_added = relative(added, parent);
  EXPECT_EQ(commit_full_bundle(map, bundle).n_followed_keyframes, 1);
  expect_committed(1);
  expect_equal(relative(added, parent), T_added);
}

TEST_F(FullBundleCommitting, WinsOverLocalBundleAdjustment) {
  ASSERT_TRUE(local_bundle_adjustment(map, kf(40), nullptr).committed);
  ASSERT_NE(map.find(kf(40))->T_cw.matrix(), solved(kf(40)).matrix());
  EXPECT_TRUE(commit_full_bundle(map, bundle).committed);
  expect_committed();
  EXPECT_LT(cost_of(map), cost_before);
}

TEST_F(FullBundleCommitting, PointsMadeMeanwhileStayBeforeTheirReferenceKeyframe) {
  const MapPointId gone = map.find(kf(50))->map_points[3];
  const Eigen::Vector3d place = map.find(gone)->position;
  map.erase_point(gone);
  const MapPointId point = map.add_point(place, kf(50), 50);
  map.add_observation(point, kf(50), 3);
  map.update_point(point);
  const Eigen::Vector3d p_c = map.find(kf(50))->T_cw * place;
  const FullBundleCommit commit = commit_full_bundle(map, bundle);
  EXPECT_EQ(commit.n_followed_points, 1);
  expect_committed();
  EXPECT_GT((map.find(point)->position - place).norm(), 1e-6);
  EXPECT_TRUE((map.find(kf(50))->T_cw * map.find(point)->position).isApprox(p_c, 1e-12));
}

TEST_F(FullBundleCommitting, AClearedMapStaysAsItIs) {
  map.clear();
  map.add_keyframe(make_raster_frame(0, 10), Pose());
  expect_not_committed();
}

TEST_F(FullBundleCommitting, ALoopClosedMeanwhileIsNotTornOpen) {
  map.count_big_change();
  expect_not_committed();
}

TEST_F(FullBundleCommitting, UnsolvedBundlesAreNotCommitted) {
  bundle = gather_full_bundle(map);
  expect_not_committed();
  const std::atomic<bool> abort{true};
  solve_full_bundle(bundle, {}, &abort, 1);
  expect_not_committed();
  FullBundleOptions none;
  none.iterations = 0;
  solve_full_bundle(bundle, none, nullptr, 1);
  expect_not_committed();
}

TEST_F(FullBundleCommitting, ResultsThatAreNotFiniteAreNotCommitted) {
  bundle = gather_full_bundle(map);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  bundle.problem.cameras[7].T_cw = Pose(Eigen::Quaterniond::Identity(), {nan, 0, 0});
  solve_full_bundle(bundle, {}, nullptr, 1);
  EXPECT_FALSE(bundle.solved);
  expect_not_committed();
}

TEST_F(FullBundleCommitting, IsTheSameForTheSameChanges) {
  LoopMap other(small_loop());
  GatheredBundle again = gather_full_bundle(other.map);
  solve_full_bundle(again, {}, nullptr, 1);
  for (Map* changed : {&map, &other.map}) {
    changed->erase_keyframe(kf(20));
    changed->publish(
        changed->add_keyframe(make_raster_frame(100, 10, 3), changed->find(kf(59))->T_cw));
  }
  ASSERT_TRUE(commit_full_bundle(map, bundle).committed);
  ASSERT_TRUE(commit_full_bundle(other.map, again).committed);
  EXPECT_EQ(content_hash(map), content_hash(other.map));
}

TEST_F(FullBundleCommitting, TakesInWhatChangesWhileItIsPrepared) {
  std::atomic<bool> stop{false};
  std::vector<KeyFrameId> added;
  std::thread tracker([&] {
    while (!stop) {
      const auto lock = map.write_lock();
      const KeyFrameId id = map.add_keyframe(make_raster_frame(100, 40, 3), Pose());
      map.set_pose(id, map.find(kf(59))->T_cw);
      const MapPointId point =
          map.add_point(map.find(id)->T_cw.inverse() * Eigen::Vector3d(0, 0, 3), id, 100);
      map.add_observation(point, id, 0);
      map.update_point(point);
      map.publish(id);
      added.push_back(id);
    }
  });
  const bool committed = commit_full_bundle(map, bundle).committed;
  stop = true;
  tracker.join();
  ASSERT_TRUE(committed);
  expect_committed();
  // Everyone made before the commit went along, and later ones were made where 59 is now.
  for (const KeyFrameId id : added) {
    expect_equal(map.find(id)->T_cw, map.find(kf(59))->T_cw);
    const Eigen::Vector3d p_c =
        map.find(id)->T_cw * map.find(map.find(id)->map_points[0])->position;
    EXPECT_TRUE(p_c.isApprox(Eigen::Vector3d(0, 0, 3), 1e-9));
  }
}

TEST(FullBundleTimeLimit, NoTimeNoChange) {
  LoopMap loop(small_loop());
  const std::uint64_t before = content_hash(loop.map);
  FullBundleOptions options;
  options.max_seconds = 1e-9;
  const FullBundleResult result = full_bundle_adjustment(loop.map, options, nullptr);
  EXPECT_TRUE(result.summary.timed_out);
  EXPECT_FALSE(result.summary.aborted);
  EXPECT_EQ(result.summary.iterations, 0);
  EXPECT_FALSE(result.committed);
  EXPECT_EQ(content_hash(loop.map), before);
}

TEST(FullBundleTimeLimit, EnoughTimeChangesNothing) {
  LoopMap a(small_loop()), b(small_loop());
  FullBundleOptions options;
  full_bundle_adjustment(a.map, options, nullptr);
  options.max_seconds = 1e4;
  EXPECT_FALSE(full_bundle_adjustment(b.map, options, nullptr).summary.timed_out);
  EXPECT_EQ(content_hash(a.map), content_hash(b.map));
}

TEST(FullBundleTimeLimit, WhatWasReachedIsUsed) {
  for (double seconds = 0.002; seconds < 20; seconds *= 1.3) {
    LoopMap loop(small_loop());
    const double before = cost_of(loop.map);
    FullBundleOptions options;
    options.max_seconds = seconds;
    const FullBundleResult result = full_bundle_adjustment(loop.map, options, nullptr);
    ASSERT_EQ(result.committed, result.summary.iterations > 0);
    if (!result.summary.timed_out) break;  // from here on there is always enough time
    if (result.summary.iterations == 0) continue;
    EXPECT_LT(cost_of(loop.map), before);
    EXPECT_THAT(check_invariants(loop.map, false), IsEmpty());
    return;
  }
  GTEST_SKIP() << "no limit fell between the first step and the last";
}

TEST(FullBundleLoop, SpreadsWhatTheLoopHasLeft) {
  for (const double depth_limit : {8.0, 0.0}) {
    LoopMapOptions options = small_loop();
    options.n_keyframes = 120;
    options.turn_drift = 2e-3;
    options.move_drift = 0.02;
    options.depth_limit = depth_limit;
    LoopMap loop(options);
    const double cost = cost_of(loop.map), error = loop.point_error();
    const FullBundleResult result = full_bundle_adjustment(loop.map, {}, nullptr);
    ASSERT_TRUE(result.committed);
    EXPECT_LT(result.summary.final_cost, 0.5 * cost);
    EXPECT_NEAR(cost_of(loop.map), result.summary.final_cost, 1e-6 * cost);
    // Two residuals of variance 0.49 an observation, three with depth, less the unknowns.
    EXPECT_LT(result.summary.final_cost, 1.5 * result.n_observations);
    EXPECT_LT(loop.point_error(), error) << depth_limit;
  }
}

}  // namespace
}  // namespace orbslam::testing
