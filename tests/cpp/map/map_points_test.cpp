// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "base/errors.hpp"
#include "map/map.hpp"
#include "map_builder.hpp"

namespace orbslam::testing {
namespace {

TEST(MapPoints, AnObservationIsEnteredOnBothSidesAndWeightedByDepth) {
  MapBuilder builder;
  Map& map = builder.map;
  builder.add_keyframe();                             // 0: no depth
  builder.add_keyframe(true, MapBuilder::kSlots, 2);  // 1: depth
  const MapPointId id = map.add_point({0, 0, 5}, kf(0), 7);
  map.add_observation(id, kf(0), 3);
  map.add_observation(id, kf(1), 4);
  const MapPoint& point = *map.find(id);
  EXPECT_EQ(point.observation_count, 3);
  EXPECT_EQ(point.first_frame, 7);
  EXPECT_EQ(point.first_keyframe, kf(0));
  EXPECT_EQ(map.find(kf(0))->map_points[3], id);
  EXPECT_EQ(map.find(kf(1))->map_points[4], id);
  EXPECT_EQ(point.observation_of(kf(1))->index, 4U);
  EXPECT_TRUE(point.observation_of(kf(1))->has_depth);
  EXPECT_EQ(point.observation_of(kf(2)), nullptr);
  EXPECT_EQ(point.n_visible.value(), 1);
  EXPECT_EQ(point.n_found.value(), 1);
}

TEST(MapPoints, ASecondObservationInAKeyframeIsIgnored) {
  MapBuilder builder;
  builder.add_keyframe();
  const MapPointId id = builder.add_point({kf(0)});
  builder.map.add_observation(id, kf(0), 9);
  EXPECT_EQ(builder.map.find(id)->observation_of(kf(0))->index, 0U);
  EXPECT_FALSE(builder.map.find(kf(0))->map_points[9].valid());
  EXPECT_EQ(builder.map.find(id)->observation_count, 1);
}

TEST(MapPoints, ASlotThatHoldsALivingPointIsNotTaken) {
  MapBuilder builder;
  builder.add_keyframes(2);
  const MapPointId a = builder.add_point({kf(0)});
  const MapPointId b = builder.add_point({kf(1)});
  builder.map.add_observation(b, kf(0), 0);
  EXPECT_EQ(builder.map.find(kf(0))->map_points[0], a);
  EXPECT_EQ(builder.map.find(b)->observation_count, 1);
}

TEST(MapPoints, AddingToTheDeadOrOutOfRangeThrows) {
  MapBuilder builder;
  builder.add_keyframe();
  const MapPointId id = builder.add_point({kf(0)});
  EXPECT_THROW(builder.map.add_observation(id, kf(0), MapBuilder::kSlots), StateError);
  EXPECT_THROW(builder.map.add_observation(id, kf(5), 0), StateError);
  builder.map.erase_point(id);
  EXPECT_THROW(builder.map.add_observation(id, kf(0), 0), StateError);
  EXPECT_THROW(builder.map.set_position(id, {0, 0, 1}), StateError);
  EXPECT_NO_THROW(builder.map.erase_point(id));
  EXPECT_NO_THROW(builder.map.erase_observation(id, kf(0)));
}

TEST(MapPoints, DiesWithTwoMonocularObservationsLeft) {
  MapBuilder builder;
  builder.add_keyframes(4);
  const MapPointId id = builder.add_point(kfs({0, 1, 2, 3}));
  builder.map.erase_observation(id, kf(3));
  ASSERT_TRUE(builder.map.find(id));
  EXPECT_EQ(builder.map.find(id)->observation_count, 3);
  builder.map.erase_observation(id, kf(2));
  EXPECT_FALSE(builder.map.find(id));
  for (const KeyFrameId k : kfs({0, 1, 2, 3})) {
    EXPECT_FALSE(builder.map.find(k)->map_points[0].valid());
  }
  EXPECT_EQ(builder.map.n_points(), 0U);
}

TEST(MapPoints, DiesWithOneStereoObservationLeft) {
  MapBuilder builder;
  for (int i = 0; i < 3; ++i) builder.add_keyframe(true, 10, 2);
  const MapPointId id = builder.add_point(kfs({0, 1, 2}));
  EXPECT_EQ(builder.map.find(id)->observation_count, 6);
  builder.map.erase_observation(id, kf(0));
  EXPECT_TRUE(builder.map.find(id));
  builder.map.erase_observation(id, kf(1));
  EXPECT_FALSE(builder.map.find(id));
}

// OD-52: the reference always observes the point.
TEST(MapPoints, ALostReferenceIsReplacedByTheLowestObserver) {
  MapBuilder builder;
  builder.add_keyframes(5);
  const MapPointId id = builder.add_point(kfs({3, 4, 2, 1}));
  EXPECT_EQ(builder.map.find(id)->reference_keyframe, kf(3));
  builder.map.erase_observation(id, kf(3));
  EXPECT_EQ(builder.map.find(id)->reference_keyframe, kf(1));
  EXPECT_EQ(builder.violations(), "");
}

TEST(MapPoints, ErasingAnotherObservationKeepsTheReference) {
  MapBuilder builder;
  builder.add_keyframes(5);
  const MapPointId id = builder.add_point(kfs({3, 4, 2, 1}));
  builder.map.erase_observation(id, kf(1));
  EXPECT_EQ(builder.map.find(id)->reference_keyframe, kf(3));
}

// OD-53: a replaced point is gone, its id leads to the successor.
TEST(MapPoints, ReplacingMovesObservationsAndCounters) {
  MapBuilder builder;
  builder.add_keyframes(4);
  const MapPointId survivor = builder.add_point(kfs({0, 1}));
  const MapPointId dying = builder.add_point(kfs({1, 2, 3}));
  builder.map.count_visible(dying, 4);
  builder.map.count_found(dying, 2);
  builder.map.replace_point(dying, survivor);

  EXPECT_FALSE(builder.map.find(dying));
  EXPECT_EQ(builder.map.resolve(dying), survivor);
  const MapPoint& point = *builder.map.find(survivor);
  EXPECT_EQ(point.observation_count, 4);
  EXPECT_EQ(point.n_visible.value(), 6);
  EXPECT_EQ(point.n_found.value(), 4);
  // Keyframe 1 saw both: the slot of the dying one is free.
  EXPECT_EQ(builder.map.find(kf(1))->map_points[0], survivor);
  EXPECT_FALSE(builder.map.find(kf(1))->map_points[1].valid());
  EXPECT_EQ(builder.map.find(kf(2))->map_points[0], survivor);
  EXPECT_EQ(builder.violations(), "");
}

// OD-54: the direction does not stay behind.
TEST(MapPoints, ReplacingRefreshesTheSurvivor) {
  MapBuilder builder;
  builder.add_keyframes(5);
  const MapPointId survivor = builder.add_point(kfs({0}));
  const MapPointId dying = builder.add_point(kfs({1, 2, 3, 4}));
  builder.map.replace_point(dying, survivor);
  Eigen::Vector3d expected = Eigen::Vector3d::Zero();
  for (int k = 0; k < 5; ++k) expected += Eigen::Vector3d(-k, 0, 5).normalized() / 5;
  EXPECT_TRUE(builder.map.find(survivor)->mean_direction.isApprox(expected, 1e-12));
}

// OD-55: not one link only.
TEST(MapPoints, ChainsOfReplacementsAreFollowedToTheEnd) {
  MapBuilder builder;
  builder.add_keyframes(4);
  std::vector<MapPointId> points;
  for (int k = 0; k < 4; ++k) points.push_back(builder.add_point({kf(k)}));
  builder.map.replace_point(points[0], points[1]);
  builder.map.replace_point(points[1], points[2]);
  EXPECT_EQ(builder.map.resolve(points[0]), points[2]);
  // The dead successor stands for its own successor.
  builder.map.replace_point(points[3], points[0]);
  EXPECT_EQ(builder.map.resolve(points[3]), points[2]);
  EXPECT_EQ(builder.map.find(points[2])->observation_count, 4);
  builder.map.erase_point(points[2]);
  for (const MapPointId id : points) EXPECT_FALSE(builder.map.resolve(id).valid());
  EXPECT_FALSE(builder.map.resolve(MapPointId()).valid());
}

// OD-54: no point is replaced by a dead one.
TEST(MapPoints, ReplacingByItselfOrByTheDeadDoesNothing) {
  MapBuilder builder;
  builder.add_keyframes(2);
  const MapPointId a = builder.add_point(kfs({0, 1}));
  const MapPointId b = builder.add_point(kfs({0, 1}));
  const MapPointId dead = builder.add_point(kfs({0}));
  builder.map.erase_point(dead);
  builder.map.replace_point(a, a);
  builder.map.replace_point(a, dead);
  builder.map.replace_point(dead, a);
  EXPECT_EQ(builder.map.find(a)->n_visible.value(), 1);
  builder.map.replace_point(b, a);
  builder.map.replace_point(a, b);  // b leads to a
  ASSERT_TRUE(builder.map.find(a));
  EXPECT_EQ(builder.map.find(a)->observation_count, 2);
  EXPECT_EQ(builder.violations(), "");
}

TEST(MapPoints, CountersFollowReplacementsAndIgnoreTheDead) {
  MapBuilder builder;
  builder.add_keyframe();
  const MapPointId a = builder.add_point({kf(0)});
  const MapPointId b = builder.add_point({kf(0)});
  builder.map.replace_point(a, b);
  builder.map.count_visible(a, 5);
  builder.map.count_found(a);
  EXPECT_EQ(builder.map.find(b)->n_visible.value(), 7);
  EXPECT_EQ(builder.map.find(b)->n_found.value(), 3);
  EXPECT_DOUBLE_EQ(builder.map.find(b)->found_ratio(), 3.0 / 7.0);
  builder.map.erase_point(b);
  EXPECT_NO_THROW(builder.map.count_visible(a));
}

TEST(MapPoints, ReplacementsAreForgottenAfterFiftyKeyframes) {
  MapBuilder builder;
  builder.add_keyframe();
  const MapPointId a = builder.add_point({kf(0)});
  const MapPointId b = builder.add_point({kf(0)});
  builder.map.replace_point(a, b);
  for (int i = 0; i < 50; ++i) builder.add_keyframe(true, 1);
  EXPECT_EQ(builder.map.resolve(a), b);
  builder.add_keyframe(true, 1);
  EXPECT_FALSE(builder.map.resolve(a).valid());
  EXPECT_EQ(builder.map.resolve(b), b);
}

TEST(MapPoints, GeometryFollowsTheObservers) {
  Map map;
  FeatureSpec feature;
  feature.level = 2;
  const KeyFrameId a = map.add_keyframe(make_synthetic_frame(0, {feature}), Pose());
  feature.level = 0;
  const KeyFrameId b = map.add_keyframe(
      make_synthetic_frame(1, {feature}),
      Pose(Eigen::Quaterniond::Identity(), Eigen::Vector3d(-3, 0, 0)));  // centre at x = 3
  const MapPointId id = map.add_point({0, 0, 4}, a, 0);
  map.add_observation(id, a, 0);
  map.add_observation(id, b, 0);
  map.update_geometry(id);
  const MapPoint& point = *map.find(id);
  // Unit vectors (0, 0, 1) and (-3, 0, 4) / 5.
  EXPECT_TRUE(point.mean_direction.isApprox(Eigen::Vector3d(-0.3, 0, 0.9), 1e-12));
  EXPECT_NEAR(point.max_distance, 4 * 1.44, 1e-6);
  EXPECT_NEAR(point.min_distance, 4 * 1.44 / 3.583182, 1e-5);
}

}  // namespace
}  // namespace orbslam::testing
