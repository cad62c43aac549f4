// SPDX-License-Identifier: BSD-3-Clause
#include "loops/map_merge.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "loops/loop_choice.hpp"
#include "loops/ring_scene.hpp"
#include "map/anchor.hpp"

namespace orbslam {
namespace {

using namespace testing;
using ::testing::ElementsAre;

/// A lap cut in two without drift, the second part in a world that a known similarity leads to.
RingOptions two_maps(bool monocular) {
  RingOptions options;
  options.monocular = monocular;
  options.turn_drift = 0;
  options.second_map_from = 33;
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(2.2, Eigen::Vector3d(0.3, -1, 0.5).normalized()));
  options.S_21 = Similarity(monocular ? 2.5 : 1, turn, Eigen::Vector3d(40, -7, 300));
  return options;
}

double difference(const Similarity& a, const Similarity& b) {
  return (a.matrix() - b.matrix()).cwiseAbs().maxCoeff();
}

/// The same place seen the other way round: the older map's keyframe is the present one.
Loop turned_round(const RingScene& scene) {
  Loop loop;
  loop.current = scene.matched();
  loop.matched = scene.current();
  loop.S_cm = scene.loop.S_cm.inverse();
  loop.S_cw = loop.S_cm * Similarity(scene.map.T_cw(loop.matched));
  loop.matches.resize(scene.map.find(loop.current)->map_points.size());
  const std::vector<MapPointId>& slots = scene.map.find(loop.matched)->map_points;
  for (std::size_t i = 0; i < slots.size(); ++i) {
    const MapPoint* older = scene.map.find(scene.loop.matches[i]);
    const Observation* seen = older ? older->observation_of(loop.current) : nullptr;
    if (seen) loop.matches[seen->index] = slots[i];
  }
  loop.loop_points = slots;
  return loop;
}

TEST(MapMerge, TheYoungerMapMovesIntoTheWorldOfTheOlder) {
  for (const bool monocular : {false, true}) {
    for (const bool seen_from_older : {false, true}) {
      RingScene scene(two_maps(monocular));
      ASSERT_EQ(scene.violations(), "");
      ASSERT_THAT(scene.map.maps(), ElementsAre(0, 1));
      ASSERT_EQ(scene.map.active_map(), 1);
      const Pose root_was = scene.map.T_cw(KeyFrameId(0));
      const double scale_was = scene.map.find(KeyFrameId(40))->scale;
      const Loop loop = seen_from_older ? turned_round(scene) : scene.loop;

      const MapMerge merge = plan_map_merge(scene.map, loop, !monocular);
      EXPECT_EQ(merge.kept, 0);
      EXPECT_EQ(merge.moved, 1);
      EXPECT_LT(difference(merge.S_km, scene.options.S_21.inverse()), 1e-6);
      const MapMergeResult result = apply_map_merge(scene.map, merge);
      ASSERT_TRUE(result.applied);
      EXPECT_EQ(scene.violations(), "");
      EXPECT_THAT(scene.map.maps(), ElementsAre(0));
      EXPECT_EQ(scene.map.active_map(), 0);
      EXPECT_EQ(result.n_moved_keyframes, 33);
      EXPECT_NEAR(result.scale, monocular ? 1 / 2.5 : 1, 1e-9);
      EXPECT_NEAR(scene.map.find(KeyFrameId(40))->scale, scale_was * result.scale, 1e-9);

      // All of it is where it is in the real world.
      EXPECT_EQ(scene.map.T_cw(KeyFrameId(0)).matrix(), root_was.matrix());
      const Pose T_world = scene.truth[0].inverse() * scene.map.T_cw(KeyFrameId(0));
      for (std::size_t k = 0; k < scene.truth.size(); ++k) {
        const Pose expected = scene.truth[k] * T_world;
        EXPECT_LT((scene.map.T_cw(RingScene::id(k)).matrix() - expected.matrix()).norm(), 1e-6);
      }
      EXPECT_LT(scene.largest_reprojection_error(), 1e-2);
      EXPECT_EQ(scene.map.big_change_index(), 1U);
    }
  }
}

TEST(MapMerge, MakesOnePointOfTwoAndOneTree) {
  RingScene scene(two_maps(true));
  const int doubles = scene.n_doubles();
  ASSERT_GT(doubles, 100);
  const MapMergeResult result =
      apply_map_merge(scene.map, plan_map_merge(scene.map, scene.loop, false));
  EXPECT_GE(result.n_fused, doubles);
  EXPECT_LT(scene.n_doubles(), doubles / 10);
  EXPECT_GT(scene.map.weight(scene.current(), scene.matched()), 100);
  EXPECT_THAT(scene.map.find(scene.current())->loop_edges, ElementsAre(scene.matched()));
  EXPECT_EQ(scene.map.find(scene.current())->parent, scene.matched());
  EXPECT_TRUE(scene.map.find(KeyFrameId(33))->parent.valid());
  EXPECT_EQ(scene.map.n_keyframes_of(0), scene.truth.size());
  // What follows from poses and observations is up to date.
  for (const MapPointId id : scene.map.point_ids()) {
    const MapPoint written = *scene.map.find(id);
    scene.map.update_point(id);
    const MapPoint& fresh = *scene.map.find(id);
    EXPECT_LT((written.mean_direction - fresh.mean_direction).norm(), 1e-12);
    EXPECT_NEAR(written.max_distance, fresh.max_distance, 1e-9 * fresh.max_distance);
  }
}

TEST(MapMerge, FramesAndNewKeyframesMoveWithTheirMap) {
  RingScene scene(two_maps(true));
  const KeyFrameId last = scene.current();
  TrackedFrame frame(scene.map.find(last)->frame);
  frame.T_cw = scene.map.T_cw(last);
  anchor_frame(scene.map, frame, last);
  EXPECT_EQ(frame.anchor.map, 1);
  const MapMerge merge = plan_map_merge(scene.map, scene.loop, false);
  // The tracker inserts a keyframe before the maps are joined.
  std::vector<std::size_t> seen;
  const KeyFrameId late = scene.map.add_keyframe(scene.make_frame(66, seen), scene.map.T_cw(last));
  ASSERT_TRUE(apply_map_merge(scene.map, merge).applied);
  EXPECT_EQ(scene.map.map_of(late), 0);
  EXPECT_LT((scene.map.T_cw(late).matrix() - scene.map.T_cw(last).matrix()).norm(), 1e-9);
  EXPECT_NEAR(move_with_anchor(scene.map, frame), 1 / 2.5, 1e-9);
  EXPECT_LT((frame.T_cw->matrix() - scene.map.T_cw(last).matrix()).norm(), 1e-9);
  EXPECT_EQ(frame.anchor.map, 0);
}

TEST(MapMerge, NothingHappensWithinOneMapOrAfterAChange) {
  RingScene alone;
  EXPECT_EQ(plan_map_merge(alone.map, alone.loop, true).kept, kNoMap);
  EXPECT_FALSE(apply_map_merge(alone.map, MapMerge()).applied);

  RingScene scene(two_maps(false));
  EXPECT_TRUE(plan_loop_correction(scene.map, scene.loop, true).keyframes.empty());
  const MapMerge merge = plan_map_merge(scene.map, scene.loop, true);
  scene.map.erase_map(1);
  EXPECT_EQ(scene.violations(), "");
  EXPECT_FALSE(apply_map_merge(scene.map, merge).applied);
  EXPECT_THAT(scene.map.maps(), ElementsAre(0));
}

TEST(MapMerge, TheRestFollowsWhatTheSeamWasMovedBy) {
  RingScene scene(two_maps(false));
  ASSERT_TRUE(apply_map_merge(scene.map, plan_map_merge(scene.map, scene.loop, true)).applied);
  const KeyFramePoses before = poses_of_map(scene.map, 0);
  const std::vector<KeyFrameId> seam = keyframes_of_seam(scene.map, scene.current());
  ASSERT_LT(seam.size(), before.ids.size());
  // All of the seam is moved alike: so is the rest.
  const Eigen::Vector3d shift(0.1, -0.05, 0.2);
  for (const KeyFrameId id : seam) {
    const Pose& T_cw = scene.map.find(id)->T_cw;
    scene.map.set_pose(id, T_cw * Pose(Eigen::Quaterniond::Identity(), -shift));
  }
  ASSERT_TRUE(spread_from_seam(scene.map, before, seam, true, nullptr));
  EXPECT_EQ(scene.violations(), "");
  for (std::size_t k = 0; k < before.ids.size(); ++k) {
    const Eigen::Vector3d moved = scene.map.T_cw(before.ids[k]).center() - before.T_cw[k].center();
    EXPECT_LT((moved - shift).norm(), 1e-5) << before.ids[k].value;
  }
  // Nothing is left to spread.
  EXPECT_FALSE(spread_from_seam(scene.map, poses_of_map(scene.map, 0), {}, true, nullptr));
}

TEST(MergeChoice, PlacesOfTwoMapsOrFarApartContradictEachOther) {
  RingScene scene(two_maps(false));
  const Loop& loop = scene.loop;
  EXPECT_FALSE(choose_merge(scene.map, {}, true));
  ASSERT_TRUE(choose_merge(scene.map, {loop}, true));

  Loop nearby = loop;
  nearby.matched = KeyFrameId(loop.matched.value + 1);
  nearby.n_matches = loop.n_matches + 5;
  const auto best = choose_merge(scene.map, {loop, nearby}, true);
  ASSERT_TRUE(best);
  EXPECT_EQ(best->matched, nearby.matched);

  Loop elsewhere = loop;
  elsewhere.S_cw = loop.S_cw * Similarity(Pose(Eigen::Quaterniond::Identity(), {3, 0, 3}));
  EXPECT_FALSE(choose_merge(scene.map, {loop, elsewhere}, true));
  Loop here = loop;
  here.matched = KeyFrameId(loop.current.value - 1);
  EXPECT_FALSE(choose_merge(scene.map, {loop, here}, true));
}

}  // namespace
}  // namespace orbslam
