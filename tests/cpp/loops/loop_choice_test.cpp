// SPDX-License-Identifier: BSD-3-Clause
#include "loops/loop_choice.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "loops/lap.hpp"

namespace orbslam {
namespace {

using namespace testing;

constexpr double kEps = 1e-6;

TEST(AssessDrift, KnownAnswersOnAStraightWay) {
  Lap lap;
  lap.add({0, 0, 0}, 0);
  lap.walk(20, 0.5);
  const Loop loop = lap.loop(kf(20), kf(0), {0.1, 0, 0.2}, 0.05, 0.9);
  const LoopDrift drift = assess_drift(lap.map, loop, false);
  EXPECT_NEAR(drift.path, 10, 1e-9);
  EXPECT_NEAR(drift.turned, 0, 1e-6);
  EXPECT_NEAR(drift.reach, 10, 1e-9);
  EXPECT_NEAR(drift.scene_depth, Lap::kDepth, 1e-9);
  EXPECT_NEAR(drift.translation, std::hypot(0.1, 0.2), 1e-9);
  EXPECT_NEAR(drift.rotation, 0.05, 1e-9);
  EXPECT_NEAR(drift.scale, 0.9, 1e-9);
  const double depth = drift.scene_depth;
  EXPECT_NEAR(drift.max_translation, 0.4 + 0.1 * depth + 10 * (-std::log(0.9) + 0.05), kEps);
  EXPECT_NEAR(drift.max_rotation, 0.1 + 0.01 * 10 / depth, kEps);
  EXPECT_NEAR(drift.max_log_scale, std::log(1.5) + 0.01 * 10 / depth, kEps);
  EXPECT_TRUE(drift.plausible());

  const LoopDrift rigid = assess_drift(lap.map, loop, true);
  EXPECT_NEAR(rigid.max_translation, 0.4 + 0.1 * depth, kEps);
  EXPECT_EQ(rigid.max_log_scale, 0);
  EXPECT_FALSE(rigid.plausible());  // the scale
}

TEST(AssessDrift, TurningWidensTheLimits) {
  Lap lap;
  lap.add({0, 0, 0}, 0);
  for (int i = 1; i <= 10; ++i) lap.add({0, 0, 0}, 0.1 * i);
  const LoopDrift drift = assess_drift(lap.map, lap.loop(kf(10), kf(0), {0, 0, 0}), true);
  EXPECT_NEAR(drift.path, 0, 1e-9);
  EXPECT_NEAR(drift.turned, 1, 1e-9);
  EXPECT_NEAR(drift.max_translation, 0.02 * drift.scene_depth + 0.1 * drift.scene_depth, kEps);
  EXPECT_NEAR(drift.max_rotation, 0.1 + 0.03, kEps);
}

TEST(AssessDrift, EachLimitIsALimit) {
  Lap lap;
  lap.add({0, 0, 0}, 0);
  lap.walk(20, 0.5);
  const auto plausible = [&](double moved, double turned, double scale, bool fix_scale) {
    return assess_drift(lap.map, lap.loop(kf(20), kf(0), {moved, 0, 0}, turned, scale), fix_scale)
        .plausible();
  };
  const LoopDrift none = assess_drift(lap.map, lap.loop(kf(20), kf(0), {0, 0, 0}), true);
  EXPECT_TRUE(plausible(0, 0, 1, true));
  EXPECT_TRUE(plausible(none.max_translation - kEps, 0, 1, true));
  EXPECT_FALSE(plausible(none.max_translation + kEps, 0, 1, true));
  EXPECT_TRUE(plausible(0, none.max_rotation - kEps, 1, true));
  EXPECT_FALSE(plausible(0, none.max_rotation + kEps, 1, true));
  EXPECT_FALSE(plausible(0, 0, 1.001, true));
  const double most =
      assess_drift(lap.map, lap.loop(kf(20), kf(0), {0, 0, 0}), false).max_log_scale;
  for (const double sign : {1.0, -1.0}) {
    EXPECT_TRUE(plausible(0, 0, std::exp(sign * (most - kEps)), false));
    EXPECT_FALSE(plausible(0, 0, std::exp(sign * (most + kEps)), false));
  }
}

TEST(AssessDrift, RotationNeverExceedsSixtyDegrees) {
  Lap lap;
  lap.add({0, 0, 0}, 0);
  for (int round = 0; round < 20; ++round) lap.walk(10, 2, 4 * kRightAngle / 10);
  const LoopDrift drift = assess_drift(lap.map, lap.loop(lap.last(), kf(0), {0, 0, 0}), true);
  EXPECT_NEAR(drift.max_rotation, 2 * kRightAngle / 3, kEps);
  EXPECT_FALSE(
      assess_drift(lap.map, lap.loop(lap.last(), kf(0), {0, 0, 0}, kRightAngle), true).plausible());
}

TEST(AssessDrift, RepeatingWallsAreToldFromThePlaceSeenAgain) {
  // The pictures on the walls come again every four metres: a match with a keyframe four metres
  // on would move the end of the lap by as much.
  Lap lap;
  walk_lap(lap);
  for (const bool fix_scale : {true, false}) {
    EXPECT_TRUE(assess_drift(lap.map, lap.loop(kf(53), kf(1), {0.1, 0.1, -0.1}, 0.05), fix_scale)
                    .plausible());
    for (const double moved : {4.0, -4.0}) {
      // ... whether the keyframe is across the gap (9) or a little back (45).
      for (const std::int64_t matched : {9, 45}) {
        const Loop loop = lap.loop(kf(53), kf(matched), {0, 0, moved}, 0.05);
        EXPECT_FALSE(assess_drift(lap.map, loop, fix_scale).plausible()) << moved;
      }
    }
  }
  // Nor does the drift of scale of a single camera explain it, which does explain more than the
  // path alone.
  EXPECT_FALSE(
      assess_drift(lap.map, lap.loop(kf(53), kf(9), {0, 0, 4}, 0, 0.87), false).plausible());
  EXPECT_TRUE(
      assess_drift(lap.map, lap.loop(kf(53), kf(1), {0, 0, 2.5}, 0, 0.87), false).plausible());
  EXPECT_FALSE(assess_drift(lap.map, lap.loop(kf(53), kf(1), {0, 0, 2.5}), true).plausible());
}

TEST(AssessDrift, RoomsThatLookAlikeAreNotJoined) {
  // Around in a room, out and through a passage, and around in one that is turned by 180 degrees.
  Lap lap;
  lap.add({0, 0, 0}, 0);
  lap.walk(12, 0.5, 4 * kRightAngle / 12);
  lap.walk(18, 0.5);
  lap.walk(12, 0.5, 4 * kRightAngle / 12);
  for (const bool fix_scale : {true, false}) {
    const Loop joins = lap.loop(kf(42), kf(0), {0, 0, -9}, 2 * kRightAngle);
    EXPECT_FALSE(assess_drift(lap.map, joins, fix_scale).plausible());
    // Were they not turned, they still are too far apart.
    EXPECT_FALSE(assess_drift(lap.map, lap.loop(kf(42), kf(0), {0, 0, -9}), fix_scale).plausible());
  }
}

TEST(AssessDrift, ALoopThatIsClosedNarrowsTheLimits) {
  Lap lap;
  walk_lap(lap);
  const Loop loop = lap.loop(kf(53), kf(1), {0, 0, 1});
  EXPECT_TRUE(assess_drift(lap.map, loop, true).plausible());
  lap.map.add_loop_edge(kf(52), kf(0));
  EXPECT_FALSE(assess_drift(lap.map, loop, true).plausible());
}

TEST(AssessDrift, DeadKeyframesExplainNothing) {
  Lap lap;
  lap.add({0, 0, 0}, 0);
  lap.walk(4, 0.5);
  const Loop loop = lap.loop(kf(4), kf(2), {0, 0, 0});
  EXPECT_TRUE(assess_drift(lap.map, loop, true).plausible());
  ASSERT_TRUE(lap.map.erase_keyframe(kf(2)));
  EXPECT_FALSE(assess_drift(lap.map, loop, true).plausible());
  const Loop of_dead = lap.loop(kf(4), kf(1), {0, 0, 0});
  EXPECT_TRUE(assess_drift(lap.map, of_dead, true).plausible());
  ASSERT_TRUE(lap.map.erase_keyframe(kf(4)));
  EXPECT_FALSE(assess_drift(lap.map, of_dead, true).plausible());
  EXPECT_FALSE(LoopDrift().plausible());
}

struct Choice : ::testing::Test {
  Choice() { walk_lap(lap); }
  Loop loop(std::int64_t matched, const Eigen::Vector3d& moved, int n_matches,
            double turned = 0) const {
    return lap.loop(kf(53), kf(matched), moved, turned, 1, n_matches);
  }
  std::optional<Loop> choose(const std::vector<Loop>& loops) const {
    return choose_loop(lap.map, loops, true);
  }
  Lap lap;
};

TEST_F(Choice, MostMatchesThenTheLowerId) {
  EXPECT_FALSE(choose({}));
  EXPECT_EQ(choose({loop(1, {0, 0, 0.1}, 50)})->matched, kf(1));
  EXPECT_EQ(choose({loop(1, {0, 0, 0.1}, 50), loop(2, {0, 0, 0.15}, 60)})->matched, kf(2));
  EXPECT_EQ(choose({loop(2, {0, 0, 0.1}, 50), loop(1, {0, 0, 0.15}, 50)})->matched, kf(1));
}

TEST_F(Choice, TheLoopComesBackWhole) {
  Loop given = loop(1, {0, 0, 0.1}, 50);
  given.matches = {MapPointId(3), MapPointId()};
  given.loop_points = {MapPointId(3), MapPointId(4)};
  given.n_inliers = 30;
  const auto chosen = choose({given});
  ASSERT_TRUE(chosen);
  EXPECT_EQ(chosen->matches, given.matches);
  EXPECT_EQ(chosen->loop_points, given.loop_points);
  EXPECT_EQ(chosen->n_inliers, 30);
  EXPECT_EQ(chosen->S_cw.matrix(), given.S_cw.matrix());
}

TEST_F(Choice, ContradictionsLeaveNothing) {
  // Both could be drift, but they cannot both be right: their far ends are half a metre apart.
  const Loop a = loop(1, {0, 0, 0.9}, 80), b = loop(2, {0, 0, -0.9}, 50);
  EXPECT_TRUE(choose({a}));
  EXPECT_TRUE(choose({b}));
  EXPECT_FALSE(choose({a, b}));
  const Loop turned = loop(1, {0, 0, 0}, 50, 0.15), back = loop(2, {0, 0, 0}, 50, -0.15);
  EXPECT_TRUE(choose({turned}));
  EXPECT_TRUE(choose({back}));
  EXPECT_FALSE(choose({turned, back}));
  // Also when neither of the two is the strongest.
  EXPECT_FALSE(choose({loop(3, {0, 0, 0}, 90), a, b}));
}

TEST_F(Choice, LoopsThatDriftCannotExplainHaveNoSay) {
  const Loop far = loop(9, {0, 0, 4}, 200);
  EXPECT_FALSE(choose({far}));
  EXPECT_EQ(choose({far, loop(1, {0, 0, 0.1}, 50)})->matched, kf(1));
}

TEST_F(Choice, DriftBetweenTheFarEndsIsNoContradiction) {
  // 10 m of way lie between 1 and 21: one may be off against the other.
  const Loop a = loop(1, {0, 0, 0.45}, 50), b = loop(21, {0, 0, -0.45}, 60);
  EXPECT_EQ(choose({a, b})->matched, kf(21));
  const Loop near = loop(2, {0, 0, -0.45}, 60);
  EXPECT_FALSE(choose({a, near}));
}

TEST_F(Choice, AllMustBeOfOneKeyframe) {
  EXPECT_THROW(choose({loop(1, {0, 0, 0}, 50), lap.loop(kf(52), kf(1), {0, 0, 0})}),
               std::invalid_argument);
}

TEST_F(Choice, DeadKeyframesLeaveNothing) {
  const Loop given = loop(1, {0, 0, 0.1}, 50);
  ASSERT_TRUE(lap.map.erase_keyframe(kf(1)));
  EXPECT_FALSE(choose({given}));
}

TEST(MayBeOnePlace, WhatTheErrorOfTwoPosesExplainsIs) {
  Lap lap;
  lap.add({0, 0, 0}, 0);
  lap.walk(20, 0.5);
  const auto one_place = [&](int a, int b, double moved, double turned) {
    const Pose T_aw = lap.poses[static_cast<std::size_t>(a)];
    const Pose there = standing_at(T_aw.center() + Eigen::Vector3d(moved, 0, 0), turned);
    return may_be_one_place(lap.map, kf(a), T_aw, kf(b), there, true);
  };
  // Two measurements may be off by 1.5 * 0.1 * 3 m and 1.5 * 0.1 rad.
  EXPECT_TRUE(one_place(10, 10, 0.45 - kEps, 0));
  EXPECT_FALSE(one_place(10, 10, 0.45 + kEps, 0));
  EXPECT_TRUE(one_place(10, 10, 0, 0.15 - kEps));
  EXPECT_FALSE(one_place(10, 10, 0, 0.15 + kEps));
  // 4 % of the 10 m between their keyframes on top, and 0.01 rad per 3 m.
  EXPECT_TRUE(one_place(20, 0, 0.85 - kEps, 0));
  EXPECT_FALSE(one_place(20, 0, 0.85 + kEps, 0));
  EXPECT_TRUE(one_place(20, 0, 0, 0.15 + 0.1 / 3 - kEps));
  EXPECT_FALSE(one_place(20, 0, 0, 0.15 + 0.1 / 3 + kEps));
}

TEST(MayBeOnePlace, ScaleDriftsWithoutDepth) {
  Lap lap;
  lap.add({0, 0, 0}, 0);
  lap.walk(20, 0.5);
  const Pose there = standing_at(lap.poses[0].center() + Eigen::Vector3d(1.2, 0, 0), 0);
  EXPECT_FALSE(may_be_one_place(lap.map, kf(0), lap.poses[0], kf(20), there, true));
  EXPECT_TRUE(may_be_one_place(lap.map, kf(0), lap.poses[0], kf(20), there, false));
}

TEST(MayBeOnePlace, NobodyKnowsWhereDeadKeyframesLie) {
  Lap lap;
  lap.add({0, 0, 0}, 0);
  lap.walk(20, 0.5);
  const Pose there = standing_at({5, 0, 0}, 0);
  EXPECT_FALSE(may_be_one_place(lap.map, kf(1), lap.poses[1], kf(5), there, true));
  ASSERT_TRUE(lap.map.erase_keyframe(kf(5)));
  EXPECT_TRUE(may_be_one_place(lap.map, kf(1), lap.poses[1], kf(5), there, true));
}

}  // namespace
}  // namespace orbslam
