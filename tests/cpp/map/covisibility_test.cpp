// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "map_builder.hpp"

namespace orbslam::testing {
namespace {

TEST(Covisibility, FifteenSharedPointsMakeANeighbour) {
  MapBuilder builder;
  builder.add_keyframes(4);
  builder.add_points(14, kfs({0, 1}));
  builder.add_points(15, kfs({0, 2}));
  builder.add_points(20, kfs({0, 3}));
  builder.map.update_connections(kf(0));
  EXPECT_EQ(builder.map.find(kf(0))->neighbours, kfs({3, 2}));
  EXPECT_EQ(builder.map.weight(kf(0), kf(1)), 14);
  EXPECT_EQ(builder.map.weight(kf(1), kf(0)), 14);
  EXPECT_EQ(builder.violations(), "");
}

TEST(Covisibility, WithoutFifteenTheBestOneIsTheNeighbour) {
  MapBuilder builder;
  builder.add_keyframes(4);
  builder.add_points(3, kfs({0, 1}));
  builder.add_points(5, kfs({0, 2}));
  builder.add_points(5, kfs({0, 3}));
  builder.map.update_connections(kf(0));
  EXPECT_EQ(builder.map.find(kf(0))->neighbours, kfs({2}));  // the tie goes to the lower id
  EXPECT_EQ(builder.map.find(kf(1))->neighbours, kfs({0}));
  builder.add_points(12, kfs({0, 1}));
  builder.map.update_connections(kf(1));
  EXPECT_EQ(builder.map.find(kf(0))->neighbours, kfs({1}));
  EXPECT_EQ(builder.violations(), "");
}

TEST(Covisibility, EqualWeightsAreOrderedById) {
  MapBuilder builder;
  builder.add_keyframes(4);
  builder.add_points(16, kfs({3, 2}));
  builder.add_points(16, kfs({3, 0}));
  builder.add_points(17, kfs({3, 1}));
  builder.map.update_connections(kf(3));
  EXPECT_EQ(builder.map.find(kf(3))->neighbours, kfs({1, 0, 2}));
}

// OD-51: both ends list each other or neither does.
TEST(Covisibility, RecountingFollowsLostPointsOnBothEnds) {
  MapBuilder builder;
  builder.add_keyframes(3);
  const auto shared = builder.add_points(20, kfs({0, 1}));
  builder.add_points(18, kfs({1, 2}));
  builder.map.update_connections(kf(1));
  for (const MapPointId id : shared) builder.map.erase_point(id);
  builder.map.update_connections(kf(1));
  EXPECT_EQ(builder.map.weight(kf(0), kf(1)), 0);
  EXPECT_TRUE(builder.map.find(kf(0))->weights.empty());
  EXPECT_TRUE(builder.map.find(kf(0))->neighbours.empty());
  EXPECT_EQ(builder.map.find(kf(1))->neighbours, kfs({2}));
  EXPECT_EQ(builder.violations(), "");
}

TEST(Covisibility, WeightsFallAndRise) {
  MapBuilder builder;
  builder.add_keyframes(2);
  const auto shared = builder.add_points(20, kfs({0, 1}));
  builder.map.update_connections(kf(0));
  builder.map.erase_point(shared[3]);
  builder.map.update_connections(kf(1));
  EXPECT_EQ(builder.map.weight(kf(0), kf(1)), 19);
  builder.add_points(4, kfs({0, 1}));
  builder.map.update_connections(kf(0));
  EXPECT_EQ(builder.map.weight(kf(1), kf(0)), 23);
}

TEST(Covisibility, QueriesGivePrefixes) {
  MapBuilder builder;
  builder.add_keyframes(4);
  builder.add_points(20, kfs({0, 1}));
  builder.add_points(40, kfs({0, 2}));
  builder.add_points(30, kfs({0, 3}));
  builder.map.update_connections(kf(0));
  EXPECT_EQ(builder.map.best_neighbours(kf(0), 2), kfs({2, 3}));
  EXPECT_EQ(builder.map.best_neighbours(kf(0), 10), kfs({2, 3, 1}));
  EXPECT_EQ(builder.map.best_neighbours(kf(99), 10), kfs({})) << "it has died";
  EXPECT_EQ(builder.map.weight(kf(1), kf(2)), 0);
  EXPECT_EQ(builder.map.weight(kf(9), kf(2)), 0);
}

}  // namespace
}  // namespace orbslam::testing
