// SPDX-License-Identifier: BSD-3-Clause
#include "matching/by_words.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/errors.hpp"
#include "matching/scenes.hpp"

namespace orbslam {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;
using namespace testing;

using Pairs = std::vector<std::pair<std::uint32_t, std::uint32_t>>;

std::shared_ptr<Frame> frame_of(const std::vector<int>& bits,
                                const std::vector<std::uint32_t>& nodes = {}) {
  std::vector<FeatureSpec> features(bits.size());
  for (std::size_t i = 0; i < bits.size(); ++i) {
    features[i].u = 50.0F + 10.0F * static_cast<float>(i);
    features[i].v = 100;
    features[i].depth = 5;
    features[i].descriptor = thermometer_descriptor(bits[i]);
  }
  auto frame = make_synthetic_frame(0, features);
  put_under_nodes(*frame, [&](std::size_t i) { return nodes.empty() ? 3U : nodes[i]; });
  return frame;
}

// A keyframe all of whose features have points.
KeyFrameId add_full(Map& map, std::shared_ptr<Frame> frame) {
  const std::size_t n = frame->size();
  const KeyFrameId id = map.add_keyframe(std::move(frame), Pose());
  map.publish(id);
  for (std::size_t i = 0; i < n; ++i) {
    const MapPointId point = map.add_point({0, 0, 5.0 + static_cast<double>(i)}, id, 0);
    map.add_observation(point, id, i);
    map.update_point(point);
  }
  return id;
}

std::vector<MapPointId> match(const std::shared_ptr<Frame>& keyframe,
                              const std::shared_ptr<Frame>& frame, float ratio = 0.7F) {
  Map map;
  const KeyFrameId id = add_full(map, keyframe);
  TrackedFrame tracked(frame);
  const int n = match_keyframe_by_words(map, id, tracked, ratio);
  EXPECT_EQ(n, std::count_if(tracked.map_points.begin(), tracked.map_points.end(),
                             [](MapPointId p) { return p.valid(); }));
  return tracked.map_points;
}

TEST(MatchKeyFrameByWords, OnlyFeaturesUnderTheSameNode) {
  EXPECT_THAT(match(frame_of({10}, {4}), frame_of({10}, {4})), ElementsAre(MapPointId(0)));
  EXPECT_THAT(match(frame_of({10}, {4}), frame_of({10}, {5})), ElementsAre(MapPointId()));
  EXPECT_THAT(match(frame_of({10, 200}, {2, 9}), frame_of({200, 10}, {9, 5})),
              ElementsAre(MapPointId(1), MapPointId()));
}

TEST(MatchKeyFrameByWords, LimitIsFiftyInclusive) {
  EXPECT_THAT(match(frame_of({0}), frame_of({50})), ElementsAre(MapPointId(0)));
  EXPECT_THAT(match(frame_of({0}), frame_of({51})), ElementsAre(MapPointId()));
}

TEST(MatchKeyFrameByWords, RatioIsStrict) {
  EXPECT_THAT(match(frame_of({0}), frame_of({30, 40}), 0.75F), Each(MapPointId()));
  EXPECT_THAT(match(frame_of({0}), frame_of({29, 40}), 0.75F),
              ElementsAre(MapPointId(0), MapPointId()));
}

TEST(MatchKeyFrameByWords, AFrameFeatureIsTakenOnce) {
  // Both keyframe features fit; the second finds the frame's feature taken.
  EXPECT_THAT(match(frame_of({0, 1}), frame_of({1})), ElementsAre(MapPointId(0)));
  // What is taken does not count as second best either.
  EXPECT_THAT(match(frame_of({0, 20}), frame_of({1, 22}), 0.9F),
              ElementsAre(MapPointId(0), MapPointId(1)));
}

TEST(MatchKeyFrameByWords, ReplacesAssociationsAndCopiesPositions) {
  Map map;
  const KeyFrameId keyframe = add_full(map, frame_of({0, 100}));
  TrackedFrame tracked(frame_of({100, 250}));
  tracked.associate(0, MapPointId(55), {9, 9, 9});
  tracked.associate(1, MapPointId(56), {9, 9, 9});
  EXPECT_EQ(match_keyframe_by_words(map, keyframe, tracked, 0.7F), 1);
  EXPECT_THAT(tracked.map_points, ElementsAre(MapPointId(1), MapPointId()));
  EXPECT_EQ(tracked.positions[0], Eigen::Vector3d(0, 0, 6));
}

TEST(MatchKeyFrameByWords, DeadPointsAndKeyFrames) {
  Map map;
  const KeyFrameId keyframe = add_full(map, frame_of({0, 100}));
  map.erase_point(MapPointId(0));
  TrackedFrame tracked(frame_of({0, 100}));
  EXPECT_EQ(match_keyframe_by_words(map, keyframe, tracked, 0.7F), 1);
  EXPECT_THAT(tracked.map_points, ElementsAre(MapPointId(), MapPointId(1)));
  EXPECT_EQ(match_keyframe_by_words(map, KeyFrameId(17), tracked, 0.7F), 0);
  EXPECT_THAT(tracked.map_points, Each(MapPointId()));
}

TEST(MatchKeyFrameByWords, RotationMustAgreeWithTheMajority) {
  Scene scene(150, 1);
  const KeyFrameId keyframe = scene.add_keyframe(Pose());
  scene.observe_all(keyframe);
  const ProjectedFrame now = project_cloud(5, scene.cloud, Pose());
  put_under_nodes(*now.frame, [&](std::size_t i) {
    return static_cast<std::uint32_t>(now.points[i]) % Scene::kNodes;
  });
  for (auto& keypoint : now.frame->keypoints) keypoint.angle = 350;
  now.frame->keypoints[8].angle = 90;
  TrackedFrame tracked(now.frame);
  const int n = match_keyframe_by_words(scene.map, keyframe, tracked, 0.7F);
  EXPECT_EQ(n, static_cast<int>(now.points.size()) - 1);
  EXPECT_FALSE(tracked.map_points[8].valid());
}

TEST(MatchKeyFrameByDescriptors, NodesDoNotCount) {
  Map map;
  const KeyFrameId keyframe = add_full(map, frame_of({10, 200}, {2, 9}));
  TrackedFrame tracked(frame_of({200, 10, 90}, {1, 5, 7}));
  tracked.associate(2, MapPointId(55), {9, 9, 9});
  EXPECT_EQ(match_keyframe_by_descriptors(map, keyframe, tracked, 0.7F), 2);
  EXPECT_THAT(tracked.map_points, ElementsAre(MapPointId(1), MapPointId(0), MapPointId()));
  EXPECT_EQ(tracked.positions[0], Eigen::Vector3d(0, 0, 6));
  EXPECT_EQ(match_keyframe_by_descriptors(map, KeyFrameId(17), tracked, 0.7F), 0);
  EXPECT_THAT(tracked.map_points, Each(MapPointId()));
}

TEST(MatchKeyFrameByDescriptors, AlikeOnBothSidesWithinLimitAndRatio) {
  const auto matches = [](const std::vector<int>& of_keyframe, const std::vector<int>& of_frame) {
    Map map;
    const KeyFrameId keyframe = add_full(map, frame_of(of_keyframe));
    TrackedFrame tracked(frame_of(of_frame));
    match_keyframe_by_descriptors(map, keyframe, tracked, 0.75F);
    return tracked.map_points;
  };
  EXPECT_THAT(matches({0}, {64}), ElementsAre(MapPointId(0)));
  EXPECT_THAT(matches({0}, {65}), ElementsAre(MapPointId()));
  EXPECT_THAT(matches({0}, {29, 40}), ElementsAre(MapPointId(0), MapPointId()));
  EXPECT_THAT(matches({0}, {30, 40}), Each(MapPointId()));
  // The frame's feature is nearer to the second one of the keyframe.
  EXPECT_THAT(matches({0, 18}, {10, 100}), ElementsAre(MapPointId(1), MapPointId()));
}

TEST(MatchKeyFrameByDescriptors, NeedsNoWords) {
  Map map;
  const KeyFrameId keyframe = add_full(map, make_raster_frame(0, 5));
  TrackedFrame tracked(make_raster_frame(0, 5));
  EXPECT_NO_THROW(match_keyframe_by_descriptors(map, keyframe, tracked, 0.7F));
}

TEST(MatchKeyFrameByWords, NeedsWords) {
  Map map;
  const KeyFrameId keyframe = add_full(map, frame_of({0}));
  TrackedFrame tracked(make_raster_frame(0, 5));
  EXPECT_THROW(match_keyframe_by_words(map, keyframe, tracked, 0.7F), StateError);
}

TEST(MatchKeyFrameByWords, EmptyFrames) {
  const auto empty = frame_of({});
  EXPECT_THAT(match(empty, frame_of({1})), Each(MapPointId()));
  EXPECT_THAT(match(frame_of({1}), empty), IsEmpty());
}

TEST(MatchKeyFramesByWords, BothSidesNeedPoints) {
  Map map;
  const KeyFrameId a = add_full(map, frame_of({0, 100, 200}));
  const KeyFrameId b = add_full(map, frame_of({200, 100, 0}));
  EXPECT_THAT(match_keyframes_by_words(map, a, b, 0.75F),
              ElementsAre(Pair(0, 2), Pair(1, 1), Pair(2, 0)));
  map.erase_point(map.find(b)->map_points[1]);
  map.erase_point(map.find(a)->map_points[2]);
  EXPECT_THAT(match_keyframes_by_words(map, a, b, 0.75F), ElementsAre(Pair(0, 2)));
}

// OD-80: one limit in both searches by words.
TEST(MatchKeyFramesByWords, LimitIsFiftyInclusiveAsForFrames) {
  Map map;
  const KeyFrameId a = add_full(map, frame_of({0}));
  EXPECT_THAT(match_keyframes_by_words(map, a, add_full(map, frame_of({50})), 0.75F),
              ElementsAre(Pair(0, 0)));
  EXPECT_THAT(match_keyframes_by_words(map, a, add_full(map, frame_of({51})), 0.75F), IsEmpty());
}

TEST(MatchKeyFramesByWords, OneToOneAndAscendingOnRandomScenes) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    Scene scene(500, seed);
    std::mt19937_64 random(seed);
    ProjectionOptions options;
    options.flipped_bits = 15;
    const KeyFrameId a = scene.add_keyframe(small_motion(random, 0.1, 0.5));
    options.seed = seed + 9;
    const KeyFrameId b = scene.add_keyframe(small_motion(random, 0.1, 0.5), options);
    scene.observe_all(a);
    scene.observe_all(b);
    const Pairs pairs = match_keyframes_by_words(scene.map, a, b, 0.75F);
    EXPECT_GT(pairs.size(), 100U);
    std::vector<bool> used(scene.projected[1].points.size(), false);
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      EXPECT_TRUE(k == 0 || pairs[k - 1].first < pairs[k].first);
      EXPECT_FALSE(used[pairs[k].second]);
      used[pairs[k].second] = true;
      EXPECT_EQ(scene.projected[0].points[pairs[k].first],
                scene.projected[1].points[pairs[k].second]);
    }
  }
}

TEST(MatchKeyFramesByWords, DeadKeyFrameMatchesNothing) {
  Map map;
  const KeyFrameId a = add_full(map, frame_of({0}));
  EXPECT_THAT(match_keyframes_by_words(map, a, KeyFrameId(9), 0.75F), IsEmpty());
}

}  // namespace
}  // namespace orbslam
