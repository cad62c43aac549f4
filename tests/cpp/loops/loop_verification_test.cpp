// SPDX-License-Identifier: BSD-3-Clause
#include "loops/loop_verification.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "loops/loop_scene.hpp"
#include "map/content_hash.hpp"

namespace orbslam {
namespace {

using namespace testing;

std::optional<Loop> verify(const TwiceMappedScene& scene, bool fix_scale, std::uint64_t seed = 0) {
  LoopVerificationOptions options;
  options.fix_scale = fix_scale;
  options.seed = seed;
  return verify_loop_candidate(scene.map, scene.kCurrent, scene.kMatched, options);
}

/// How many matches there are, and none of them wrong.
int n_right(const TwiceMappedScene& scene, const Loop& loop) {
  int n = 0;
  for (std::size_t i = 0; i < loop.matches.size(); ++i) {
    if (!loop.matches[i].valid()) continue;
    EXPECT_EQ(loop.matches[i], scene.partner(i)) << i;
    ++n;
  }
  return n;
}

/// How many of the matches are between points of both keyframes.
int n_mutual(const TwiceMappedScene& scene, const Loop& loop) {
  const KeyFrame* current = scene.map.find(scene.kCurrent);
  int n = 0;
  for (std::size_t i = 0; i < loop.matches.size(); ++i) {
    if (!loop.matches[i].valid() || !scene.map.find(current->map_points[i])) continue;
    n += scene.map.find(loop.matches[i])->observation_of(scene.kMatched) ? 1 : 0;
  }
  return n;
}

ProjectionOptions noisy() {
  ProjectionOptions options;
  options.pixel_noise = 1;
  options.flipped_bits = 15;
  return options;
}

TEST(VerifyLoopCandidate, RecoversARigidDrift) {
  for (const double turn : {0.0, 0.2, 3.0}) {
    const TwiceMappedScene scene(drift_by(turn, 2));
    scene.expect_consistent();
    const auto loop = verify(scene, true);
    ASSERT_TRUE(loop) << turn;
    EXPECT_EQ(loop->current, scene.kCurrent);
    EXPECT_EQ(loop->matched, scene.kMatched);
    EXPECT_LT(difference(loop->S_cm, scene.true_S_cm()), 1e-5);
    EXPECT_LT(difference(loop->S_cw, scene.true_S_cw()), 1e-5);
    EXPECT_EQ(loop->S_cm.scale(), 1.0);
    EXPECT_EQ(loop->S_cw.scale(), 1.0);
    EXPECT_GT(loop->n_inliers, 300);
  }
}

TEST(VerifyLoopCandidate, RecoversADriftOfScale) {
  for (const double scale : {0.8, 1.0, 1.25}) {
    ProjectionOptions options;
    options.with_depth = false;
    const TwiceMappedScene scene(drift_by(0.3, 1.5, scale), 400, options);
    const auto loop = verify(scene, false);
    ASSERT_TRUE(loop) << scale;
    EXPECT_NEAR(loop->S_cm.scale(), scale, 1e-5);
    EXPECT_LT(difference(loop->S_cm, scene.true_S_cm()), 1e-5);
    EXPECT_LT(difference(loop->S_cw, scene.true_S_cw()), 1e-5);
    EXPECT_EQ(n_right(scene, *loop), loop->n_matches);
  }
}

TEST(VerifyLoopCandidate, AFixedScaleIsNotBent) {
  // Half as large a second time: with the scale fixed that is another place.
  EXPECT_FALSE(verify(TwiceMappedScene(drift_by(0.1, 1, 0.5)), true));
  const auto loop = verify(TwiceMappedScene(drift_by(0.1, 1, 1.01)), true);
  ASSERT_TRUE(loop);
  EXPECT_EQ(loop->S_cm.scale(), 1.0);
}

TEST(VerifyLoopCandidate, SurvivesNoiseAndWrongMatches) {
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    TwiceMappedScene scene(drift_by(0.2, 1), 400, noisy(), seed);
    std::mt19937_64 random(seed);
    for (std::size_t i = 0; i < 400; i += 2) {
      scene.displace(i, drift_by(uniform(random, 0, 3), uniform(random, 1, 5)));
    }
    for (const bool fix_scale : {false, true}) {
      const auto loop = verify(scene, fix_scale);
      ASSERT_TRUE(loop) << seed;
      EXPECT_LT(difference(loop->S_cm, scene.true_S_cm()), 0.05) << seed;
      EXPECT_GT(n_right(scene, *loop), 300);
    }
  }
}

TEST(VerifyLoopCandidate, MatchesAndPointsAreThoseOfTheLoop) {
  const TwiceMappedScene scene(drift_by(0.1, 1), 400, noisy());
  const auto loop = verify(scene, true);
  ASSERT_TRUE(loop);
  EXPECT_EQ(loop->matches.size(), scene.map.find(scene.kCurrent)->map_points.size());
  EXPECT_EQ(n_right(scene, *loop), loop->n_matches);
  EXPECT_GE(loop->n_matches, loop->n_inliers);
  // Points of keyframes 0 to 2, each once.
  std::set<MapPointId> expected;
  for (const MapPointId id : scene.first_lap) {
    if (id.valid()) expected.insert(id);
  }
  const std::set<MapPointId> found(loop->loop_points.begin(), loop->loop_points.end());
  EXPECT_EQ(found, expected);
  EXPECT_EQ(loop->loop_points.size(), expected.size());
}

TEST(VerifyLoopCandidate, NeighboursOfTheCandidateAddPoints) {
  // The candidate itself has lost half of its points, the keyframes beside it know them still.
  TwiceMappedScene scene(drift_by(0.1, 1));
  int n_lost = 0;
  for (std::size_t i = 0; i < 400; i += 2) {
    const MapPoint* point = scene.map.find(scene.first_lap[i]);
    if (!point || !point->observation_of(scene.kMatched)) continue;
    scene.map.erase_observation(point->id, scene.kMatched);
    n_lost += scene.map.find(scene.first_lap[i]) ? 1 : 0;
  }
  ASSERT_GT(n_lost, 100);
  const auto loop = verify(scene, true);
  ASSERT_TRUE(loop);
  EXPECT_GT(loop->n_matches, loop->n_inliers + n_lost / 2);
  EXPECT_EQ(loop->n_inliers, n_mutual(scene, *loop)) << "one-sided matches are none of them";
  EXPECT_EQ(n_right(scene, *loop), loop->n_matches);
}

/// Of a place of which the candidate knows one point in six, and with `neighbours` those beside it
/// know all.
double error_of_sparse_candidate(std::uint64_t seed, bool neighbours) {
  ProjectionOptions options;
  options.pixel_noise = 1;
  TwiceMappedScene scene(drift_by(0.1, 1), 400, options, seed);
  for (std::size_t i = 0; i < 400; ++i) {
    if (i % 6 == 0 || !scene.map.find(scene.first_lap[i])) continue;
    if (!neighbours) {
      scene.map.erase_point(scene.first_lap[i]);
    } else if (scene.map.find(scene.first_lap[i])->observation_of(scene.kMatched)) {
      scene.map.erase_observation(scene.first_lap[i], scene.kMatched);
    }
  }
  const auto loop = verify(scene, true);
  EXPECT_TRUE(loop) << seed;
  return loop ? difference(loop->S_cm, scene.true_S_cm()) : 1;
}

TEST(VerifyLoopCandidate, PointsOfTheNeighboursMakeItPrecise) {
  double with = 0;
  double without = 0;
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    with += error_of_sparse_candidate(seed, true);
    without += error_of_sparse_candidate(seed, false);
  }
  EXPECT_LT(with, 0.7 * without);
}

TEST(VerifyLoopCandidate, RansacMustFindMoreThanTheMinimum) {
  LoopVerificationOptions options;
  options.fix_scale = true;
  const auto verified = [&](std::size_t n_common) {
    // The rest of what `current` knows was not there the first time.
    TwiceMappedScene scene(drift_by(0.1, 1), 200);
    std::size_t left = 0;
    for (std::size_t i = 0; i < 200; ++i) {
      const MapPoint* point = scene.map.find(scene.first_lap[i]);
      if (!point) continue;
      const bool common = point->observation_of(scene.kMatched) && scene.points[i].valid() &&
                          scene.map.find(scene.points[i])->observation_of(scene.kCurrent);
      if (common && left < n_common) {
        ++left;
      } else {
        scene.map.erase_point(point->id);
      }
    }
    EXPECT_EQ(left, n_common);
    return verify_loop_candidate(scene.map, scene.kCurrent, scene.kMatched, options);
  };
  options.min_matches = 0;
  EXPECT_FALSE(verified(19));
  EXPECT_FALSE(verified(20));
  ASSERT_TRUE(verified(21));
  EXPECT_EQ(verified(21)->n_inliers, 21);
  options.min_word_matches = 22;
  EXPECT_FALSE(verified(21));
  options = LoopVerificationOptions();
  options.fix_scale = true;
  EXPECT_FALSE(verified(39));
  ASSERT_TRUE(verified(40));
  EXPECT_EQ(verified(40)->n_matches, 40);
}

TEST(VerifyLoopCandidate, OtherGeometryIsRefused) {
  TwiceMappedScene scene(drift_by(0.1, 1));
  std::mt19937_64 random(1);
  for (std::size_t i = 0; i < 400; ++i) {
    scene.displace(i, drift_by(uniform(random, 0, 3), uniform(random, 1, 5)));
  }
  EXPECT_FALSE(verify(scene, true));
  EXPECT_FALSE(verify(scene, false));
}

TEST(VerifyLoopCandidate, GoesOnAfterASimilarityThatImagesDisprove) {
  // Half of the common points of `current` have moved together: RANSAC, which compares points
  // with points, finds their common motion as often as the right one. Keypoints disprove it.
  TwiceMappedScene scene(drift_by(0.1, 1), 100);
  for (std::size_t i = 0; i < 100; i += 2) scene.displace(i, drift_by(0.05, 1.5));
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const auto loop = verify(scene, true, seed);
    ASSERT_TRUE(loop) << seed;
    EXPECT_LT(difference(loop->S_cm, scene.true_S_cm()), 1e-5) << seed;
  }
}

TEST(VerifyLoopCandidate, NothingForDeadOrEqualKeyframes) {
  TwiceMappedScene scene(drift_by(0.1, 1));
  const LoopVerificationOptions options;
  EXPECT_FALSE(verify_loop_candidate(scene.map, scene.kCurrent, scene.kCurrent, options));
  EXPECT_FALSE(verify_loop_candidate(scene.map, scene.kCurrent, KeyFrameId(99), options));
  EXPECT_FALSE(verify_loop_candidate(scene.map, KeyFrameId(99), scene.kMatched, options));
  ASSERT_TRUE(scene.map.erase_keyframe(scene.kMatched));
  EXPECT_FALSE(verify(scene, true));
}

TEST(VerifyLoopCandidate, EqualSeedsGiveEqualLoopsAndTheMapStays) {
  TwiceMappedScene scene(drift_by(0.2, 1), 400, noisy());
  std::mt19937_64 random(1);
  for (std::size_t i = 0; i < 400; i += 3) {
    scene.displace(i, drift_by(uniform(random, 0, 3), uniform(random, 1, 5)));
  }
  const std::uint64_t before = content_hash(scene.map);
  const auto first = verify(scene, false, 5), second = verify(scene, false, 5);
  ASSERT_TRUE(first && second);
  EXPECT_EQ(difference(first->S_cm, second->S_cm), 0);
  EXPECT_EQ(difference(first->S_cw, second->S_cw), 0);
  EXPECT_EQ(first->matches, second->matches);
  EXPECT_EQ(first->loop_points, second->loop_points);
  EXPECT_EQ(first->n_inliers, second->n_inliers);
  EXPECT_EQ(content_hash(scene.map), before);
}

}  // namespace
}  // namespace orbslam
