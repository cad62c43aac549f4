// SPDX-License-Identifier: BSD-3-Clause
#include "matching/for_initialization.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "base/errors.hpp"
#include "support/npy.hpp"
#include "support/synthetic_frames.hpp"

namespace orbslam {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;
using testing::FeatureSpec;
using testing::make_synthetic_frame;
using testing::thermometer_descriptor;

std::vector<Eigen::Vector2f> positions_of(const Frame& frame) {
  std::vector<Eigen::Vector2f> positions;
  for (const Keypoint& keypoint : frame.keypoints) positions.emplace_back(keypoint.x, keypoint.y);
  return positions;
}

FeatureSpec corner(float u, float v, int bits, std::int32_t level = 0, float angle = 0) {
  FeatureSpec spec;
  spec.u = u;
  spec.v = v;
  spec.level = level;
  spec.angle = angle;
  spec.descriptor = thermometer_descriptor(bits);
  return spec;
}

std::vector<int> match(const std::vector<FeatureSpec>& first,
                       const std::vector<FeatureSpec>& current, float moved = 0,
                       const ViewMatchOptions& options = {}) {
  const auto frame_1 = make_synthetic_frame(0, first);
  const auto frame_2 = make_synthetic_frame(1, current);
  auto expected = positions_of(*frame_1);
  for (Eigen::Vector2f& position : expected) position.x() += moved;
  return match_views(*frame_1, *frame_2, expected, options);
}

TEST(MatchViews, WhatComesNearerIsFoundOnAHigherLevel) {
  EXPECT_THAT(match({corner(200, 200, 50, 1)}, {corner(205, 200, 50, 3)}), ElementsAre(0));
  EXPECT_THAT(match({corner(200, 200, 50, 1)}, {corner(205, 200, 50, 4)}), ElementsAre(-1));
}

TEST(MatchViews, CoarseKeypointsAreLeftOut) {
  EXPECT_THAT(match({corner(200, 200, 50, 4)}, {corner(200, 200, 50, 4)}), ElementsAre(-1));
}

TEST(MatchViews, TheSameCornerOnAnotherLevelDoesNotCompete) {
  EXPECT_THAT(match({corner(200, 200, 50)}, {corner(205, 200, 50), corner(206, 200, 51, 1)}),
              ElementsAre(0));
  EXPECT_THAT(match({corner(200, 200, 50)}, {corner(205, 200, 55), corner(225, 200, 45)}),
              ElementsAre(-1));
}

TEST(MatchViews, SearchesAroundTheExpectedPosition) {
  ViewMatchOptions narrow;
  narrow.window = 10;
  const std::vector<FeatureSpec> current{corner(260, 200, 50)};
  EXPECT_THAT(match({corner(200, 200, 50)}, current, 0, narrow), ElementsAre(-1));
  EXPECT_THAT(match({corner(200, 200, 50)}, current, 55, narrow), ElementsAre(0));
}

TEST(MatchViews, TheBetterOfTwoWinsWhateverTheOrder) {
  const FeatureSpec good = corner(200, 200, 98), worse = corner(210, 200, 90);
  EXPECT_THAT(match({worse, good}, {corner(205, 205, 100)}), ElementsAre(-1, 0));
  EXPECT_THAT(match({good, worse}, {corner(205, 205, 100)}), ElementsAre(0, -1));
}

TEST(MatchViews, AsksForOnePositionPerKeypoint) {
  const auto frame = make_synthetic_frame(0, {corner(200, 200, 50)});
  EXPECT_THROW(match_views(*frame, *frame, {}, {}), StateError);
}

TEST(MatchViews, OfEquallyGoodOnesTheFirstStays) {
  const FeatureSpec one = corner(200, 200, 95), two = corner(210, 200, 95);
  EXPECT_THAT(match({one, two}, {corner(205, 205, 100)}), ElementsAre(0, -1));
}

TEST(MatchViews, DescriptorLimitIsFiftyInclusive) {
  EXPECT_THAT(match({corner(200, 200, 0)}, {corner(200, 200, 50)}), ElementsAre(0));
  EXPECT_THAT(match({corner(200, 200, 0)}, {corner(200, 200, 51)}), ElementsAre(-1));
}

TEST(MatchViews, RatioIsStrict) {
  // 9 of 10 bits: exactly the ratio 0.9, which does not pass; 8 of 10 does.
  EXPECT_THAT(match({corner(200, 200, 0)}, {corner(205, 200, 9), corner(195, 200, 10)}),
              ElementsAre(-1));
  EXPECT_THAT(match({corner(200, 200, 0)}, {corner(205, 200, 8), corner(195, 200, 10)}),
              ElementsAre(0));
}

TEST(MatchViews, WindowIsASquareAroundTheExpectedPosition) {
  EXPECT_THAT(match({corner(200, 200, 0)}, {corner(299.5F, 299.5F, 3)}), ElementsAre(0));
  EXPECT_THAT(match({corner(200, 200, 0)}, {corner(300, 200, 3)}), ElementsAre(-1));
}

TEST(MatchViews, RotationMustAgreeWithTheMajority) {
  std::mt19937_64 random(3);
  std::vector<FeatureSpec> first, current;
  for (int i = 0; i < 40; ++i) {
    FeatureSpec spec = corner(60.0F + 12.0F * static_cast<float>(i), 240, 0);
    spec.descriptor = testing::random_descriptor(random);
    current.push_back(spec);
    spec.angle = i == 17 ? 200.0F : 100.0F;
    first.push_back(spec);
  }
  const auto matches = match(first, current);
  for (std::size_t i = 0; i < matches.size(); ++i) {
    EXPECT_EQ(matches[i], i == 17 ? -1 : static_cast<int>(i));
  }
}

TEST(MatchViews, EmptyFramesAndPositionsThatAreNoNumbers) {
  EXPECT_THAT(match({}, {}), ::testing::IsEmpty());
  EXPECT_THAT(match({corner(1, 1, 0)}, {}), Each(-1));
  EXPECT_THAT(match({corner(10, 10, 0)}, {corner(10, 10, 0)}, std::nanf("")), ElementsAre(-1));
}

// ---- parity with the arrays of the original -------------------------------------------------

std::shared_ptr<Frame> golden_frame(const std::string& which, bool with_angles) {
  const std::string folder = testing::test_data("golden/match_init_tum/");
  const auto keypoints = testing::read_npy<float>(folder + "kp" + which + ".npy");
  const auto levels = testing::read_npy<std::int32_t>(folder + "kp" + which + "_octave.npy");
  const auto bytes = testing::read_npy<std::uint8_t>(folder + "desc" + which + ".npy");
  std::vector<FeatureSpec> features(keypoints.rows());
  for (std::size_t i = 0; i < features.size(); ++i) {
    features[i].u = keypoints.at(i, 0);
    features[i].v = keypoints.at(i, 1);
    if (with_angles) features[i].angle = keypoints.at(i, 3);
    features[i].level = levels.at(i);
    std::memcpy(features[i].descriptor.words.data(), bytes.values.data() + 32 * i, 32);
  }
  return make_synthetic_frame(0, features);
}

std::vector<int> golden_matches(bool with_angles) {
  const auto frame_1 = golden_frame("1", with_angles);
  const auto frame_2 = golden_frame("2", with_angles);
  ViewMatchOptions options;
  options.level_difference = 0;
  options.highest_level = 0;
  return match_views(*frame_1, *frame_2, positions_of(*frame_1), options);
}

std::vector<int> golden_output() {
  return testing::read_npy<int>(testing::test_data("golden/match_init_tum/out_matches12.npy"))
      .values;
}

// The original compares keypoints of level 0 only. With all angles zero nothing is filtered, so
// what comes out is the search itself. The original's filter (bins 0 to 12 without wrap-around) on
// top must give the original's matches exactly.
TEST(MatchViewsGolden, SearchIsIdenticalToTheOriginal) {
  std::vector<int> matches = golden_matches(false);
  const auto frame_1 = golden_frame("1", true);
  const auto frame_2 = golden_frame("2", true);
  std::array<std::vector<std::size_t>, 13> bins;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (matches[i] < 0) continue;
    float rotation = frame_1->keypoints[i].angle -
                     frame_2->keypoints[static_cast<std::size_t>(matches[i])].angle;
    if (rotation < 0) rotation += 360.0F;
    bins[static_cast<std::size_t>(std::round(rotation / 30.0F))].push_back(i);
  }
  std::array<std::size_t, 13> order{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12};
  std::stable_sort(order.begin(), order.end(),
                   [&](auto a, auto b) { return bins[a].size() > bins[b].size(); });
  for (std::size_t rank = 1; rank < order.size(); ++rank) {
    const bool kept = rank < 3 && 10 * bins[order[rank]].size() >= bins[order[0]].size();
    if (kept) continue;
    for (const std::size_t i : bins[order[rank]]) matches[i] = -1;
  }
  EXPECT_EQ(matches, golden_output());
}

// Ours has 12 bins with wrap-around, so rotations near 0 degrees count together instead of as two
// half bins. That may change which bins survive; with this pair it changes no match. (OD-79)
TEST(MatchViewsGolden, WrapAroundKeepsTheSameMatches) {
  EXPECT_EQ(golden_matches(true), golden_output());
}

}  // namespace
}  // namespace orbslam
