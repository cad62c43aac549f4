// SPDX-License-Identifier: BSD-3-Clause
#include "matching/fuse.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "matching/scenes.hpp"

namespace orbslam {
namespace {

using namespace testing;

// A point 5 m ahead, observed by two keyframes on level 0, and a target keyframe with the given
// features; where they stand is up to the caller.
struct Target {
  explicit Target(const std::vector<FeatureSpec>& features, const Pose& T_cw = Pose(),
                  const Pose& T_observers = Pose()) {
    std::vector<FeatureSpec> sights(8, feature(0));
    for (std::size_t i = 0; i < sights.size(); ++i) sights[i].u += 30.0F * static_cast<float>(i);
    for (int i = 0; i < 4; ++i) observers.push_back(add(sights, T_observers));
    id = add(features, T_cw);
    point = add_point({0, 0, 5}, 0, 2);
  }

  KeyFrameId add(const std::vector<FeatureSpec>& features, const Pose& T_cw) {
    auto frame = make_synthetic_frame(0, features);
    put_under_one_node(*frame);
    const KeyFrameId keyframe = map.add_keyframe(frame, T_cw);
    map.publish(keyframe);
    return keyframe;
  }
  // A point in slot `index` of the first n observers.
  MapPointId add_point(const Eigen::Vector3d& position, std::size_t index, std::size_t n) {
    const MapPointId made = map.add_point(position, observers[0], 0);
    for (std::size_t i = 0; i < n; ++i) map.add_observation(made, observers[i], index);
    map.update_point(made);
    return made;
  }
  int fuse() {
    const int changes = fuse_points(map, id, {point});
    EXPECT_THAT(check_invariants(map, true), ::testing::IsEmpty());
    return changes;
  }
  MapPointId slot(std::size_t index) const { return map.find(id)->map_points[index]; }

  Map map;
  std::vector<KeyFrameId> observers;
  KeyFrameId id;
  MapPointId point;
};

TEST(FusePoints, AddsAnObservation) {
  Target target({feature(0, 200), feature(0, 20)});
  EXPECT_EQ(target.fuse(), 1);
  EXPECT_EQ(target.slot(1), target.point);
  EXPECT_EQ(target.map.find(target.point)->observation_count, 3);
  EXPECT_EQ(target.fuse(), 0);  // observed already
}

TEST(FusePoints, TheFirstOfEqualsWins) {
  Target target({feature(0, 20), feature(0, 20)});
  EXPECT_EQ(target.fuse(), 1);
  EXPECT_EQ(target.slot(0), target.point);
}

TEST(FusePoints, DescriptorLimitIsFiftyInclusive) {
  EXPECT_EQ(Target({feature(0, 50)}).fuse(), 1);
  EXPECT_EQ(Target({feature(0, 51)}).fuse(), 0);
}

TEST(FusePoints, PredictedLevelAndTheFinerOne) {
  for (std::int32_t level = 0; level < 8; ++level) {
    // From 2.5 m instead of 5 the point appears log(2)/log(1.2) = 3.8 levels coarser: level 4.
    Target target({feature(level)}, at(0, 0, 2.5));
    EXPECT_EQ(target.fuse(), level == 3 || level == 4 ? 1 : 0) << level;
  }
}

TEST(FusePoints, ReprojectionGateWithoutDepth) {
  const float limit = std::sqrt(5.99F);
  EXPECT_EQ(Target({feature(0, 0, 320 + limit - 0.001F)}).fuse(), 1);
  EXPECT_EQ(Target({feature(0, 0, 320 + limit + 0.001F)}).fuse(), 0);
}

TEST(FusePoints, ReprojectionGateWithDepth) {
  for (const double sign : {-0.001, 0.001}) {
    const double error = std::sqrt(7.8) + sign;
    const auto depth = static_cast<float>(40.0 / (40.0 / 5.0 - error));
    EXPECT_EQ(Target({feature(0, 0, 320, depth)}).fuse(), sign < 0 ? 1 : 0);
  }
}

// OD-35: the right column of a near point may be negative.
TEST(FusePoints, NegativeVirtualColumnsCountAsDepth) {
  // Moved so that the point appears at u = 4, where its right column is 4 - 8 = -4.
  const double x = 316.0 * 5 / 400;
  const Pose T_cw = at(x);
  const auto fuse = [&](float depth) {
    return Target({feature(0, 0, 4, depth)}, T_cw, T_cw).fuse();
  };
  EXPECT_EQ(fuse(5), 1);
  EXPECT_EQ(fuse(2), 0);  // its column would be -16
}

TEST(FusePoints, KeyFramesExcludeTheirUpperBounds) {
  for (const float u : {0.0F, 639.9F, 640.0F}) {
    const double x = -(u - 320.0) * 5 / 400;
    EXPECT_EQ(Target({feature(0, 0, u)}, at(x), at(x)).fuse(), u < 640 ? 1 : 0) << u;
  }
}

TEST(FusePoints, PointsBehindTheCameraOrNowhere) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  for (const Eigen::Vector3d& bad :
       {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0, 0, -5), Eigen::Vector3d(0, nan, 5)}) {
    Target target({feature(0)});
    target.map.set_position(target.point, bad);
    EXPECT_EQ(target.fuse(), 0);
  }
}

TEST(FusePoints, DistanceAndViewingAngleMustFit) {
  // 1.2 * 5 m = 6 m.
  EXPECT_EQ(Target({feature(0)}, at(0, 0, -0.9)).fuse(), 1);
  EXPECT_EQ(Target({feature(0)}, at(0, 0, -1.1)).fuse(), 0);
  for (const double degrees : {59.0, 61.0}) {
    // Looking at the point from the side, 5 m away from it.
    const double angle = degrees * M_PI / 180;
    const Eigen::Matrix3d R_wc =
        Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()).toRotationMatrix();
    const Eigen::Vector3d center = Eigen::Vector3d(0, 0, 5) - 5 * R_wc.col(2);
    const Pose T_cw = Pose(R_wc, center).inverse();
    EXPECT_EQ(Target({feature(0)}, T_cw).fuse(), degrees < 60 ? 1 : 0) << degrees;
  }
}

// Whether the projected point outlives the one that is there, for given numbers of monocular
// observations.
bool projected_survives(std::size_t n_projected, std::size_t n_present) {
  Target target({feature(0)});
  target.map.erase_point(target.point);
  target.point = target.add_point({0, 0, 5}, 0, n_projected);
  const MapPointId present = target.map.add_point({0, 0, 5.01}, target.id, 0);
  target.map.add_observation(present, target.id, 0);
  for (std::size_t i = 0; i + 1 < n_present; ++i) {
    target.map.add_observation(present, target.observers[i], 1);
  }
  target.map.update_point(present);
  EXPECT_EQ(target.map.find(present)->observation_count, static_cast<int>(n_present));
  EXPECT_EQ(target.fuse(), 1);
  const MapPointId winner = target.slot(0);
  const MapPointId loser = winner == present ? target.point : present;
  EXPECT_TRUE(winner == present || winner == target.point);
  EXPECT_EQ(target.map.find(loser), nullptr);
  EXPECT_EQ(target.map.resolve(loser), winner);
  return winner == target.point;
}

TEST(FusePoints, ThePointWithMoreObservationsSurvives) {
  EXPECT_FALSE(projected_survives(2, 3));
  EXPECT_TRUE(projected_survives(4, 3));
  EXPECT_TRUE(projected_survives(3, 3));  // equal: the projected one
}

TEST(FusePoints, APointListedTwiceIsFusedOnce) {
  Target target({feature(0, 1), feature(0, 2)});
  EXPECT_EQ(fuse_points(target.map, target.id, {target.point, target.point}), 1);
  EXPECT_FALSE(target.slot(1).valid());
}

TEST(FusePoints, PointsThatMeetInOneKeypointAreMerged) {
  Target target({feature(0)});
  const MapPointId other = target.add_point({0, 0, 5.01}, 1, 4);
  EXPECT_EQ(fuse_points(target.map, target.id, {target.point, other}), 2);
  EXPECT_EQ(target.slot(0), other);  // 4 observations against 3
  EXPECT_EQ(target.map.resolve(target.point), other);
  EXPECT_THAT(check_invariants(target.map, true), ::testing::IsEmpty());
}

TEST(FusePoints, DeadPointsAndKeyFrames) {
  Target target({feature(0)});
  target.map.erase_point(target.point);
  EXPECT_EQ(target.fuse(), 0);
  EXPECT_EQ(fuse_points(target.map, target.id, {MapPointId(), MapPointId(77)}), 0);
  EXPECT_EQ(fuse_points(target.map, KeyFrameId(77), {MapPointId(0)}), 0);
}

// ---- neighbours ------------------------------------------------------------------------------

constexpr std::size_t kSharedPoints = 60;

// Keyframes in a row that share a few points and have points of their own for everything else.
std::vector<KeyFrameId> add_row_with_duplicates(Scene& scene, const std::vector<double>& xs) {
  ProjectionOptions options;
  options.flipped_bits = 5;
  std::vector<KeyFrameId> ids;
  for (const double x : xs) {
    options.seed = ids.size() + 1;
    ids.push_back(scene.add_keyframe(at(x), options));
    scene.forget(kSharedPoints, scene.points.size());
    scene.observe_all(ids.back());
  }
  return ids;
}

// Slots of the keyframe by point of the cloud.
std::vector<MapPointId> points_by_cloud(const Scene& scene, KeyFrameId id) {
  std::vector<MapPointId> points(scene.cloud.positions.size());
  const auto& seen = scene.projected[static_cast<std::size_t>(id.value)].points;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    points[seen[i]] = scene.map.find(id)->map_points[i];
  }
  return points;
}

// Among points of the cloud that both keyframes observe: how many are one point of the map.
double shared_fraction(const Scene& scene, KeyFrameId a, KeyFrameId b) {
  const auto points_a = points_by_cloud(scene, a), points_b = points_by_cloud(scene, b);
  int both = 0, same = 0;
  for (std::size_t i = 0; i < points_a.size(); ++i) {
    if (!points_a[i].valid() || !points_b[i].valid()) continue;
    ++both;
    same += points_a[i] == points_b[i];
  }
  return both ? static_cast<double>(same) / both : 0;
}

TEST(FuseWithNeighbours, DuplicatesBecomeOnePoint) {
  Scene scene(500, 1);
  const auto ids = add_row_with_duplicates(scene, {0, 0.3, 0.6});
  const std::size_t before = scene.map.n_points();
  EXPECT_LT(shared_fraction(scene, ids[0], ids[2]), 0.3);
  const int weight_before = scene.map.weight(ids[0], ids[2]);
  const int changes = fuse_with_neighbours(scene.map, ids[2], 10);
  EXPECT_GT(changes, 100);
  EXPECT_LT(scene.map.n_points(), before - 100);
  EXPECT_GT(shared_fraction(scene, ids[0], ids[2]), 0.95);
  EXPECT_GT(shared_fraction(scene, ids[1], ids[2]), 0.95);
  EXPECT_GT(scene.map.weight(ids[0], ids[2]), weight_before + 100);
  scene.expect_consistent();
}

TEST(FuseWithNeighbours, ObservationsAreAddedBothWays) {
  // Both see the cloud, but each observes another half of it.
  Scene scene(500, 2);
  const KeyFrameId a = scene.add_keyframe(at(0));
  const KeyFrameId b = scene.add_keyframe(at(0.2));
  scene.observe(a, 0, 300);
  scene.observe(b, 0, kSharedPoints);
  scene.observe(b, 300, 500);
  fuse_with_neighbours(scene.map, b, 10);
  const auto points_a = points_by_cloud(scene, a), points_b = points_by_cloud(scene, b);
  std::size_t forward = 0, backward = 0;
  for (std::size_t i = 0; i < 500; ++i) {
    if (!points_a[i].valid() || points_a[i] != points_b[i]) continue;
    (i < 300 ? backward : forward) += i >= kSharedPoints;
  }
  EXPECT_GT(forward, 80U);
  EXPECT_GT(backward, 80U);
  scene.expect_consistent();
}

TEST(FuseWithNeighbours, ReachesNeighboursOfNeighbours) {
  // The first and the last share nothing, both share with the one in the middle.
  Scene scene(600, 3);
  const KeyFrameId first = scene.add_keyframe(at(0));
  const KeyFrameId middle = scene.add_keyframe(at(0.2));
  const KeyFrameId last = scene.add_keyframe(at(0.4));
  scene.observe(first, 0, 200);
  scene.observe(middle, 0, 200);
  scene.observe(last, 200, 400);
  scene.observe(middle, 200, 400);
  scene.map.update_connections(last);
  scene.forget(400, 600);
  scene.observe(first, 400, 600);
  scene.forget(400, 600);
  scene.observe(last, 400, 600);
  ASSERT_EQ(scene.map.weight(first, last), 0);
  EXPECT_GT(fuse_with_neighbours(scene.map, last, 1), 100);
  EXPECT_GT(shared_fraction(scene, first, last), 0.95);
  scene.expect_consistent();
}

TEST(FuseWithNeighbours, PointsAndConnectionsAreRefreshed) {
  Scene scene(300, 4);
  const KeyFrameId a = scene.add_keyframe(at(0)), b = scene.add_keyframe(at(0.2));
  scene.observe_all(a);
  scene.observe_all(b);
  const MapPointId moved = scene.points[scene.projected[1].points[0]];
  const Eigen::Vector3d elsewhere = scene.map.find(moved)->position + Eigen::Vector3d(0, 0, 0.01);
  scene.map.set_position(moved, elsewhere);
  const double before = scene.map.find(moved)->max_distance;
  fuse_with_neighbours(scene.map, b, 0);
  EXPECT_NE(scene.map.find(moved)->max_distance, before);
  scene.expect_consistent();
}

TEST(FuseWithNeighbours, SameMapForTheSameInput) {
  const auto run = [] {
    Scene scene(400, 6);
    const auto ids = add_row_with_duplicates(scene, {0, 0.2, 0.4, 0.6});
    fuse_with_neighbours(scene.map, ids[3], 10);
    std::vector<std::vector<MapPointId>> slots;
    for (const KeyFrameId id : ids) slots.push_back(scene.map.find(id)->map_points);
    return slots;
  };
  EXPECT_TRUE(run() == run());
}

TEST(FuseWithNeighbours, RandomMapsStayConsistent) {
  for (std::uint64_t seed = 0; seed < 6; ++seed) {
    std::mt19937_64 random(seed);
    Scene scene(300, seed);
    std::vector<KeyFrameId> ids;
    for (int k = 0; k < 8; ++k) {
      ProjectionOptions options;
      options.with_depth = random() % 2;
      options.pixel_noise = 0.5;
      options.flipped_bits = 10;
      options.seed = random();
      ids.push_back(scene.add_keyframe(small_motion(random, 0.03, 0.3), options));
      const std::size_t begin = uniform_index(random, 200);
      scene.forget(begin, begin + 60);
      scene.observe_all(ids.back());
      if (k >= 2) fuse_with_neighbours(scene.map, ids.back(), 3);
      scene.expect_consistent();
    }
    // Fused points are where the cloud has them: nothing was merged with a wrong neighbour.
    for (const KeyFrameId id : ids) {
      const auto points = points_by_cloud(scene, id);
      for (std::size_t i = 0; i < points.size(); ++i) {
        const MapPoint* point = scene.map.find(points[i]);
        if (!point) continue;
        EXPECT_LT((point->position - scene.cloud.positions[i]).norm(), 1e-9);
      }
    }
  }
}

TEST(FuseWithNeighbours, DeadKeyFrame) {
  Map map;
  EXPECT_EQ(fuse_with_neighbours(map, KeyFrameId(1), 10), 0);
}

}  // namespace
}  // namespace orbslam
