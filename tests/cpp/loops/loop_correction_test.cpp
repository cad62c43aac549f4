// SPDX-License-Identifier: BSD-3-Clause
#include "loops/loop_correction.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "loops/correct_ring.hpp"
#include "map/content_hash.hpp"

namespace orbslam {
namespace {

using namespace testing;

TEST(LoopCorrection, TakesTheDriftOut) {
  for (const bool monocular : {false, true}) {
    RingScene scene(monocular ? single_camera() : RingOptions());
    ASSERT_EQ(scene.violations(), "");
    const auto before = scene.pose_errors();
    const Pose was = scene.map.T_cw(scene.current());
    ASSERT_GT(scene.n_doubles(), 100);
    const LoopCorrectionResult result = correct(scene);
    ASSERT_TRUE(result.applied);
    const auto after = scene.pose_errors();
    EXPECT_LT(after.first, 0.1 * before.first) << monocular;
    EXPECT_LT(after.second, 0.1 * before.second) << monocular;
    EXPECT_LT(scene.largest_reprojection_error(), 1.0) << monocular;

    const Pose is = scene.map.T_cw(scene.current());
    EXPECT_NEAR(result.translation, (is.center() - was.center()).norm(), 1e-12);
    EXPECT_NEAR(result.rotation, was.rotation().angularDistance(is.rotation()), 1e-12);
    EXPECT_LT((is.center() - scene.expected(65).center()).norm(), 0.02);
    EXPECT_EQ(scene.map.big_change_index(), 1U);
    EXPECT_THAT(scene.map.find(scene.current())->loop_edges,
                ::testing::ElementsAre(scene.matched()));
    EXPECT_THAT(scene.map.find(scene.matched())->loop_edges,
                ::testing::ElementsAre(scene.current()));
  }
}

TEST(LoopCorrection, MakesOnePointOfTwo) {
  for (const bool monocular : {false, true}) {
    RingScene scene(monocular ? single_camera() : RingOptions());
    const std::size_t before = scene.map.n_points();
    const int doubles = scene.n_doubles();
    const LoopCorrectionResult result = correct(scene);
    EXPECT_LT(scene.n_doubles(), doubles / 10);
    EXPECT_GT(result.n_fused, doubles);
    EXPECT_LE(before - scene.map.n_points(), static_cast<std::size_t>(result.n_fused));
    EXPECT_GT(scene.map.weight(scene.current(), scene.matched()), 100);
    // Whatever was matched is the point of the first visit now.
    const auto& slots = scene.map.find(scene.current())->map_points;
    for (std::size_t i = 0; i < slots.size(); ++i) {
      if (!scene.loop.matches[i].valid()) continue;
      EXPECT_EQ(slots[i], scene.loop.matches[i]);
    }
    // Nothing was mixed up: a point shows the same thing in all its keyframes.
    scene.map.for_each_point([&](const MapPoint& point) {
      const auto& descriptor = scene.map.find(point.observations[0].keyframe)
                                   ->frame->descriptors[point.observations[0].index];
      for (const Observation& seen : point.observations) {
        EXPECT_EQ(scene.map.find(seen.keyframe)->frame->descriptors[seen.index].words,
                  descriptor.words);
      }
      EXPECT_EQ(point.descriptor.words, descriptor.words);
    });
  }
}

TEST(LoopCorrection, TrustsTheMatches) {
  RingScene scene;
  // Two of them are where nobody would search for them.
  std::vector<MapPointId>& matches = scene.loop.matches;
  const auto is_match = [](MapPointId id) { return id.valid(); };
  std::iter_swap(std::find_if(matches.begin(), matches.end(), is_match),
                 std::find_if(matches.rbegin(), matches.rend(), is_match));
  correct(scene);
  const auto& slots = scene.map.find(scene.current())->map_points;
  for (std::size_t i = 0; i < slots.size(); ++i) {
    if (!matches[i].valid()) continue;
    EXPECT_EQ(slots[i], matches[i]);
  }
}

// OD-107: in a stated order, not in that of addresses.
TEST(LoopCorrection, PointsOfTheGroupMoveWithTheFirstThatSeesThem) {
  RingScene scene;
  const LoopCorrection correction = planned(scene);
  const auto carrier = [&](MapPointId id) {
    for (const auto& [point, vertex] : correction.carried) {
      if (point == id) return correction.keyframes[vertex];
    }
    return KeyFrameId();
  };
  int n_others = 0;
  for (const MapPointId id : scene.map.find(scene.current())->map_points) {
    EXPECT_EQ(carrier(id), scene.current());
    n_others += scene.map.find(id)->reference_keyframe != scene.current() ? 1 : 0;
  }
  EXPECT_GT(n_others, 100);
  for (const MapPointId id : scene.loop.loop_points) {
    EXPECT_EQ(carrier(id), scene.map.find(id)->reference_keyframe);
  }
  EXPECT_EQ(correction.carried.size(), scene.map.n_points());
}

TEST(LoopCorrection, SearchesInTheNeighboursToo) {
  RingScene scene;
  std::fill(scene.loop.matches.begin(), scene.loop.matches.end(), MapPointId());
  const LoopCorrection correction = planned(scene);
  std::vector<int> n(66, 0);
  for (const LoopCorrection::Fusion& fusion : correction.fusions) {
    ++n[static_cast<std::size_t>(fusion.keyframe.value)];
  }
  EXPECT_EQ(correction.group.front(), scene.current());
  for (const KeyFrameId id : correction.group) {
    EXPECT_GT(n[static_cast<std::size_t>(id.value)], 50) << id.value;
  }
}

TEST(LoopCorrection, WhatFollowsFromPosesAndObservationsIsUpToDate) {
  // What was worked out beforehand is what the map works out itself.
  RingOptions options = single_camera();
  options.flipped_bits = 12;
  RingScene scene(options);
  const std::vector<MapPointId> slots = scene.map.find(scene.current())->map_points;
  for (std::size_t i = 0; i < slots.size(); i += 3) scene.map.erase_point(slots[i]);  // free
  EXPECT_GT(correct(scene).n_fused, 100);
  for (const MapPointId id : scene.map.point_ids()) {
    const MapPoint written = *scene.map.find(id);
    scene.map.update_point(id);
    const MapPoint& fresh = *scene.map.find(id);
    EXPECT_EQ(written.mean_direction, fresh.mean_direction);
    EXPECT_EQ(written.min_distance, fresh.min_distance);
    EXPECT_EQ(written.max_distance, fresh.max_distance);
    EXPECT_EQ(written.descriptor.words, fresh.descriptor.words);
  }
}

TEST(LoopCorrection, WithMeasuredDepthNothingChangesItsScale) {
  RingScene scene;
  scene.loop.S_cw = Similarity(1.01, scene.loop.S_cw.rotation(), scene.loop.S_cw.translation());
  LoopCorrection correction = planned(scene);
  for (const Similarity& S_iw : correction.graph.S_iw) EXPECT_EQ(S_iw.scale(), 1.0);
  EXPECT_EQ(apply_loop_correction(scene.map, correction).scale, 1.0);
  scene.map.for_each_keyframe([](const KeyFrame& keyframe) { EXPECT_EQ(keyframe.scale, 1.0); });
}

TEST(LoopCorrection, SaysByHowMuchLengthsWereMultiplied) {
  RingScene scene(single_camera());
  const auto depths = [&](std::size_t k) {  // of the keyframe's own points that stay what they are
    std::vector<std::pair<MapPointId, double>> found;
    const KeyFrame& keyframe = *scene.map.find(RingScene::id(k));
    for (const MapPointId id : keyframe.map_points) {
      const MapPoint* point = scene.map.find(id);
      if (point && point->reference_keyframe == keyframe.id) {
        found.emplace_back(id, (keyframe.T_cw * point->position).z());
      }
    }
    return found;
  };
  const auto before = depths(30);
  const LoopCorrectionResult result = correct(scene);
  const auto after = depths(30);
  ASSERT_EQ(after.size(), before.size());
  ASSERT_GT(after.size(), 10U);
  for (std::size_t i = 0; i < after.size(); ++i) {
    EXPECT_NEAR(after[i].second / before[i].second, scene.map.find(RingScene::id(30))->scale, 1e-9);
  }
  // A unit of the map was so many metres at the end, in terms of what it was at the beginning.
  const double expected = scene.drifted[65].scale() / scene.drifted[5].scale();
  EXPECT_GT(expected, 1.1);
  EXPECT_NEAR(result.scale, expected, 0.001);
  EXPECT_EQ(scene.map.find(scene.current())->scale, result.scale);
  EXPECT_EQ(scene.map.find(scene.matched())->scale, 1.0);
}

TEST(LoopCorrection, TheFarSideStaysWhereItIs) {
  RingScene scene(single_camera());
  std::vector<std::pair<MapPointId, Eigen::Vector3d>> before;
  for (const MapPointId id : scene.loop.loop_points) {
    const MapPoint& point = *scene.map.find(id);
    if (point.reference_keyframe == scene.matched()) before.emplace_back(id, point.position);
  }
  ASSERT_GT(before.size(), 10U);
  const Pose matched = scene.map.T_cw(scene.matched());
  correct(scene);
  EXPECT_TRUE(scene.map.T_cw(scene.matched()).matrix().isApprox(matched.matrix(), 1e-14));
  for (const auto& [id, position] : before) {
    EXPECT_TRUE(scene.map.find(id)->position.isApprox(position, 1e-12));
  }
}

TEST(LoopCorrection, IsNotAppliedToAnotherMap) {
  RingScene scene;
  const LoopCorrection correction = planned(scene);
  scene.map.clear();
  EXPECT_FALSE(apply_loop_correction(scene.map, correction).applied);
  for (int k = 0; k < 66; ++k) {  // keyframes of the same ids, but of another map
    scene.map.publish(scene.map.add_keyframe(make_raster_frame(k, 10), Pose()));
  }
  const std::uint64_t before = content_hash(scene.map);
  EXPECT_FALSE(apply_loop_correction(scene.map, correction).applied);
  EXPECT_EQ(content_hash(scene.map), before);
  RingScene twin;
  twin.map.clear();
  twin.map.add_keyframe(make_raster_frame(0, 10), Pose());
  const LoopCorrection late = plan_loop_correction(twin.map, twin.loop, true);
  EXPECT_TRUE(late.keyframes.empty());
  EXPECT_FALSE(apply_loop_correction(twin.map, late).applied);
}

TEST(LoopCorrection, IsNotAppliedWithoutBothEnds) {
  for (const bool at_current : {false, true}) {
    RingScene scene;
    LoopCorrection correction = planned(scene);
    ASSERT_TRUE(scene.map.erase_keyframe(at_current ? scene.current() : scene.matched()));
    const std::uint64_t before = content_hash(scene.map);
    EXPECT_FALSE(apply_loop_correction(scene.map, correction).applied);
    EXPECT_EQ(content_hash(scene.map), before);
    EXPECT_EQ(scene.map.big_change_index(), 0U);

    LoopCorrection late = plan_loop_correction(scene.map, scene.loop, true);
    EXPECT_TRUE(late.keyframes.empty());
    EXPECT_EQ(optimize_essential_graph(late, nullptr).iterations, 0);
    EXPECT_FALSE(apply_loop_correction(scene.map, late).applied);
  }
}

TEST(LoopCorrection, PlanningChangesNothing) {
  RingScene scene;
  const std::uint64_t before = content_hash(scene.map);
  const auto structure = scene.map.structure_version(), geometry = scene.map.geometry_version();
  planned(scene);
  EXPECT_EQ(content_hash(scene.map), before);
  EXPECT_EQ(scene.map.structure_version(), structure);
  EXPECT_EQ(scene.map.geometry_version(), geometry);
}

TEST(LoopCorrection, RefusesMatchesThatDoNotFit) {
  RingScene scene;
  scene.loop.matches.pop_back();
  EXPECT_THROW(plan_loop_correction(scene.map, scene.loop, true), std::invalid_argument);
}

TEST(LoopCorrection, EndsWhenAsked) {
  RingScene scene;
  LoopCorrection correction = plan_loop_correction(scene.map, scene.loop, true);
  const std::vector<Similarity> start = correction.graph.S_iw;
  const std::atomic<bool> stop{true};
  EXPECT_TRUE(optimize_essential_graph(correction, &stop).aborted);
  for (std::size_t k = 0; k < start.size(); ++k) {
    EXPECT_EQ(correction.graph.S_iw[k].matrix(), start[k].matrix());
  }
}

TEST(LoopCorrection, IsTheSameInEveryRun) {
  for (const bool monocular : {false, true}) {
    std::vector<std::uint64_t> hashes;
    for (int run = 0; run < 2; ++run) {
      RingScene scene(monocular ? single_camera() : RingOptions());
      correct(scene);
      hashes.push_back(content_hash(scene.map));
    }
    EXPECT_EQ(hashes[0], hashes[1]);
  }
}

// OD-106: the map before or the map after.
TEST(LoopCorrection, NobodySeesAMixture) {
  RingScene scene(single_camera());
  const LoopCorrection correction = planned(scene);
  std::vector<Eigen::Matrix4d> before;
  for (std::size_t k = 0; k < scene.truth.size(); ++k) {
    before.push_back(scene.map.T_cw(RingScene::id(k)).matrix());
  }
  std::atomic<bool> started{false}, done{false};
  int n_mixed = 0, n_old = 0;
  std::thread reader([&] {
    do {
      const bool last = done;
      {
        const auto lock = scene.map.read_lock();
        const bool old = scene.map.big_change_index() == 0;
        for (std::size_t k = 0; k < before.size(); ++k) {
          if (RingScene::id(k) == scene.matched()) continue;
          n_mixed += (scene.map.T_cw(RingScene::id(k)).matrix() == before[k]) == old ? 0 : 1;
        }
        const KeyFrame& current = *scene.map.find(scene.current());
        n_mixed += current.loop_edges.empty() == old ? 0 : 1;
        n_mixed += (current.scale == 1) == old ? 0 : 1;
        n_old += old ? 1 : 0;
      }
      started = true;
      if (last) break;
    } while (true);
  });
  while (!started) std::this_thread::yield();
  EXPECT_TRUE(apply_loop_correction(scene.map, correction).applied);
  done = true;
  reader.join();
  EXPECT_EQ(n_mixed, 0);
  EXPECT_GT(n_old, 0);
}

}  // namespace
}  // namespace orbslam
