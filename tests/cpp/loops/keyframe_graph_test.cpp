// SPDX-License-Identifier: BSD-3-Clause
#include "loops/keyframe_graph.hpp"

#include <gtest/gtest.h>

#include "loops/lap.hpp"

namespace orbslam {
namespace {

using namespace testing;

KeyFrameWay way(const Lap& lap, std::int64_t from, std::int64_t to, double metres_per_radian = 1) {
  return KeyFrameGraph(lap.map).shortest_ways(kf(from), {kf(to)}, metres_per_radian).front();
}

TEST(KeyFrameGraph, AddsUpAlongTheWay) {
  Lap lap;
  lap.add({0, 0, 0}, 0);
  lap.walk(4, 0.5);
  lap.walk(2, 1.0, 0.25);
  for (const bool forth : {true, false}) {
    const KeyFrameWay found = forth ? way(lap, 0, 6) : way(lap, 6, 0);
    EXPECT_TRUE(found.exists());
    EXPECT_NEAR(found.length, 4, 1e-12);
    EXPECT_NEAR(found.turned, 0.5, 1e-12);
    EXPECT_NEAR(found.reach, (lap.poses[6].center() - lap.poses[0].center()).norm(), 1e-12);
  }
  EXPECT_EQ(way(lap, 3, 3).length, 0);
  EXPECT_EQ(way(lap, 3, 3).reach, 0);
}

TEST(KeyFrameGraph, ReachIsTheFarthestPointOfTheWay) {
  Lap lap;
  lap.add({0, 0, 0}, 0);
  for (int i = 1; i <= 5; ++i) lap.add({0, 0, 1.0 * i}, 0);
  for (int i = 4; i >= 1; --i) lap.add({0, 0.1, 1.0 * i}, 0);  // and back
  EXPECT_NEAR(way(lap, 9, 1).reach, std::hypot(4, 0.1), 1e-12);
}

TEST(KeyFrameGraph, TakesShortcuts) {
  Lap lap;
  walk_lap(lap);
  EXPECT_NEAR(way(lap, 53, 1).length, 26, 1e-9);
  EXPECT_NEAR(way(lap, 53, 1).turned, 4 * kRightAngle, 1e-9);
  lap.map.add_loop_edge(kf(52), kf(0));
  EXPECT_NEAR(way(lap, 53, 1).length, 1, 1e-9);
  EXPECT_NEAR(way(lap, 53, 1).turned, 0, 1e-6);
  // So does covisibility.
  lap.share(kf(53), 2 * Lap::kShared, kf(1), 2 * Lap::kShared);
  EXPECT_NEAR(way(lap, 53, 1).length, 0, 1e-9);
}

TEST(KeyFrameGraph, TurningHasItsPrice) {
  // From 0 to 2 by way of 1, who looks aside, or straight on by a detour of 3.
  Lap lap;
  lap.add({0, 0, 0}, 0);
  lap.add({0, 0, 1}, 1);
  lap.add({0, 0, 2}, 0);
  lap.add({2, 0, 1}, 0);
  lap.map.add_loop_edge(kf(0), kf(3));
  lap.map.add_loop_edge(kf(3), kf(2));
  EXPECT_NEAR(way(lap, 0, 2, 0.1).length, 2, 1e-12);
  EXPECT_NEAR(way(lap, 0, 2, 0.1).turned, 2, 1e-12);
  EXPECT_NEAR(way(lap, 0, 2, 10).length, 2 * std::sqrt(5.0), 1e-12);
  EXPECT_NEAR(way(lap, 0, 2, 10).turned, 0, 1e-9);
}

TEST(KeyFrameGraph, OneSearchForManyEnds) {
  Lap lap;
  walk_lap(lap);
  const std::vector<KeyFrameId> to = kfs({1, 40, 1, 99, 53});
  const auto ways = KeyFrameGraph(lap.map).shortest_ways(kf(53), to, 2);
  for (std::size_t i : {0U, 1U, 2U, 4U}) {
    EXPECT_EQ(ways[i].length, way(lap, 53, to[i].value, 2).length) << i;
    EXPECT_EQ(ways[i].turned, way(lap, 53, to[i].value, 2).turned) << i;
    EXPECT_EQ(ways[i].reach, way(lap, 53, to[i].value, 2).reach) << i;
  }
  EXPECT_FALSE(ways[3].exists());
}

TEST(KeyFrameGraph, NoWayForTheDead) {
  Lap lap;
  lap.add({0, 0, 0}, 0);
  lap.walk(4, 1);
  ASSERT_TRUE(lap.map.erase_keyframe(kf(2)));
  EXPECT_FALSE(way(lap, 0, 2).exists());
  EXPECT_FALSE(way(lap, 2, 0).exists());
  EXPECT_FALSE(way(lap, 0, -1).exists());
  // The spanning tree closes the gap.
  EXPECT_NEAR(way(lap, 0, 4).length, 4, 1e-12);
}

}  // namespace
}  // namespace orbslam
