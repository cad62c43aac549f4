// SPDX-License-Identifier: BSD-3-Clause
#include "map/culling.hpp"

#include <gtest/gtest.h>

#include "map_builder.hpp"

namespace orbslam::testing {
namespace {

// ---- recent points -----------------------------------------------------------------------------

struct RecentCase {
  int age;          ///< of the current keyframe against the point's first one
  int n_observers;  ///< monocular
  int n_visible, n_found;
  int min_observations;
  bool lives, kept;
};

class RecentPoints : public ::testing::TestWithParam<RecentCase> {};

// See docs/method/mapping.md#culling-of-points.
TEST_P(RecentPoints, FollowTheTable) {
  const RecentCase& c = GetParam();
  MapBuilder builder;
  builder.add_keyframes(6);
  std::vector<KeyFrameId> observers;
  for (int k = 0; k < c.n_observers; ++k) observers.push_back(kf(k));
  const MapPointId id = builder.add_point(observers);
  builder.map.count_visible(id, c.n_visible - 1);
  builder.map.count_found(id, c.n_found - 1);
  std::vector<MapPointId> recent{id};
  EXPECT_EQ(cull_recent_points(builder.map, kf(c.age), c.min_observations, recent),
            c.lives ? 0 : 1);
  EXPECT_EQ(builder.map.find(id) != nullptr, c.lives);
  EXPECT_EQ(recent.size(), c.kept ? 1U : 0U);
  EXPECT_EQ(builder.violations(), "");
}

INSTANTIATE_TEST_SUITE_P(
    Table, RecentPoints,
    ::testing::Values(RecentCase{0, 1, 1, 1, 2, true, true},    // young
                      RecentCase{1, 2, 1, 1, 2, true, true},    // too young to be asked
                      RecentCase{2, 2, 1, 1, 2, false, false},  // needs more than 2
                      RecentCase{2, 3, 1, 1, 2, true, true},    // has them
                      RecentCase{2, 3, 1, 1, 3, false, false},  // sensors with depth: more than 3
                      RecentCase{2, 4, 1, 1, 3, true, true},    //
                      RecentCase{3, 4, 1, 1, 3, true, false},   // probation passed
                      RecentCase{3, 3, 1, 1, 3, false, false},  //
                      RecentCase{0, 5, 4, 1, 2, true, true},    // found ratio exactly 0.25
                      RecentCase{0, 5, 5, 1, 2, false, false},  // below
                      RecentCase{5, 5, 9, 2, 2, false, false}));

TEST(RecentPoints, DeadOnesAreDroppedAndTheOrderStays) {
  MapBuilder builder;
  builder.add_keyframes(3);
  const auto points = builder.add_points(4, kfs({0, 1, 2}));
  std::vector<MapPointId> recent = points;
  builder.map.erase_point(points[1]);
  EXPECT_EQ(cull_recent_points(builder.map, kf(1), 2, recent), 0);
  EXPECT_EQ(recent, (std::vector<MapPointId>{points[0], points[2], points[3]}));
}

// ---- keyframes ---------------------------------------------------------------------------------

constexpr int kPoints = 100;

/// Keyframe 1 is asked as a neighbour of keyframe 2. `n_redundant` of its points are also seen by
/// 2, 3 and 4, the others only by 2.
struct Scene {
  MapBuilder builder;

  explicit Scene(int n_redundant, std::int32_t level_of_1 = 0, std::int32_t level_of_others = 0,
                 float depth_of_1 = -1) {
    builder.add_keyframe();
    builder.add_keyframe(true, MapBuilder::kSlots, depth_of_1, level_of_1);
    for (int k = 2; k <= 4; ++k) {
      builder.add_keyframe(true, MapBuilder::kSlots, -1, level_of_others);
    }
    builder.add_points(n_redundant, kfs({1, 2, 3, 4}));
    builder.add_points(kPoints - n_redundant, kfs({1, 2}));
    builder.map.update_connections(kf(1));
  }
  std::vector<KeyFrameId> cull(bool only_close = false) {
    return cull_keyframes(builder.map, kf(2), only_close);
  }
  bool died() const { return builder.map.find(kf(1)) == nullptr; }
};

// See docs/method/mapping.md#culling-of-keyframes.
TEST(CullKeyframes, MoreThanNinetyPerCentIsStrict) {
  Scene at_limit(90);
  at_limit.cull();
  EXPECT_FALSE(at_limit.died());
  Scene above(91);
  const auto dead = above.cull();
  EXPECT_TRUE(above.died());
  EXPECT_EQ(dead, kfs({1}));
  EXPECT_EQ(above.builder.violations(), "");
}

TEST(CullKeyframes, CoarserObserversCountUpToOneLevel) {
  Scene one_coarser(100, 2, 3);
  one_coarser.cull();
  EXPECT_TRUE(one_coarser.died());
  Scene two_coarser(100, 2, 4);
  two_coarser.cull();
  EXPECT_FALSE(two_coarser.died());
  Scene finer(100, 5, 0);
  finer.cull();
  EXPECT_TRUE(finer.died());
}

TEST(CullKeyframes, OnlyClosePointsAreAskedOfSensorsWithDepth) {
  Scene close(100, 0, 0, 3.9F);
  close.cull(true);
  EXPECT_TRUE(close.died());
  Scene far(100, 0, 0, 4.1F);
  far.cull(true);
  EXPECT_FALSE(far.died()) << "no close points, no verdict";
  Scene none(100);
  none.cull(true);
  EXPECT_FALSE(none.died());
}

TEST(CullKeyframes, KeyframeZeroTheCurrentOneAndTheProtectedStay) {
  MapBuilder builder;
  builder.add_keyframes(6);
  builder.add_points(50, kfs({0, 1, 2, 3, 4, 5}));
  builder.map.begin_lease(kf(2));
  builder.map.add_loop_edge(kf(0), kf(3));
  builder.map.update_connections(kf(5));
  const auto dead = cull_keyframes(builder.map, kf(5), false);
  EXPECT_EQ(dead, kfs({1, 4}));
  EXPECT_TRUE(builder.map.find(kf(2))->to_be_erased);
  EXPECT_EQ(builder.violations(), "");
}

TEST(CullKeyframes, EachDeathCountsForTheNextVerdict) {
  // Five keyframes share everything. 1 has four others, then 2 has three; for 3 only two are left.
  MapBuilder builder;
  builder.add_keyframes(5);
  builder.add_points(60, kfs({0, 1, 2, 3, 4}));
  builder.map.update_connections(kf(4));
  EXPECT_EQ(cull_keyframes(builder.map, kf(4), false), kfs({1, 2}));
  for (const KeyFrameId k : kfs({0, 3, 4})) EXPECT_TRUE(builder.map.find(k));
  EXPECT_TRUE(cull_keyframes(builder.map, kf(17), false).empty());
}

}  // namespace
}  // namespace orbslam::testing
