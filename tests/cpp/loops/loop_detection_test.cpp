// SPDX-License-Identifier: BSD-3-Clause
#include "loops/loop_detection.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "map/map_builder.hpp"

namespace orbslam {
namespace {

using namespace testing;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

/// Twelve keyframes; each triple (0, 1, 2), (3, 4, 5), ... shares points, and 2 also with 3.
struct Parts : MapBuilder {
  Parts() {
    add_keyframes(12);
    for (std::int64_t k = 0; k < 12; k += 3) add_points(20, kfs({k, k + 1, k + 2}));
    add_points(5, kfs({2, 3}));
    for (std::int64_t k = 0; k < 12; ++k) map.update_connections(kf(k));
  }
  std::vector<KeyFrameId> update(const std::vector<std::int64_t>& candidates) {
    return consistency.update(map, kfs(candidates));
  }
  LoopConsistency consistency;
};

TEST(LoopConsistency, TheFourthKeyframeInARowIsBelieved) {
  Parts parts;
  // Different keyframes of one part of the map.
  EXPECT_THAT(parts.update({6}), IsEmpty());
  EXPECT_THAT(parts.update({7}), IsEmpty());
  EXPECT_THAT(parts.update({8}), IsEmpty());
  EXPECT_THAT(parts.update({6}), ElementsAre(kf(6)));
  EXPECT_THAT(parts.update({7}), ElementsAre(kf(7)));
}

TEST(LoopConsistency, AnEmptyAnswerBreaksAllChains) {
  Parts parts;
  for (int i = 0; i < 3; ++i) EXPECT_THAT(parts.update({6}), IsEmpty());
  EXPECT_THAT(parts.update({}), IsEmpty());
  for (int i = 0; i < 3; ++i) EXPECT_THAT(parts.update({6}), IsEmpty());
  EXPECT_THAT(parts.update({6}), ElementsAre(kf(6)));
}

TEST(LoopConsistency, AnotherPlaceBeginsAnew) {
  Parts parts;
  for (int i = 0; i < 3; ++i) parts.update({6});
  EXPECT_THAT(parts.update({9}), IsEmpty());
  EXPECT_THAT(parts.update({6}), IsEmpty());
}

// OD-97: chains do not outlive a gap, a loop or a reset.
TEST(LoopConsistency, ClearForgetsEverything) {
  Parts parts;
  for (int i = 0; i < 3; ++i) parts.update({6});
  parts.consistency.clear();
  for (int i = 0; i < 3; ++i) EXPECT_THAT(parts.update({6}), IsEmpty());
  EXPECT_THAT(parts.update({6}), ElementsAre(kf(6)));
}

TEST(LoopConsistency, ChainsRunSideBySide) {
  Parts parts;
  parts.update({6});
  parts.update({6, 9});
  parts.update({6, 9});
  EXPECT_THAT(parts.update({6, 9}), ElementsAre(kf(6)));
  EXPECT_THAT(parts.update({6, 9}), ElementsAre(kf(6), kf(9)));
}

TEST(LoopConsistency, WeakConnectionsMakeAPartOfTheMapToo) {
  Parts parts;
  // 0, 1, 2 and, through 5 points, 3: what 2 and what 3 propose is the same part.
  for (int i = 0; i < 2; ++i) parts.update({2});
  parts.update({4});  // 3, 4, 5 share 3 with the part of 2
  EXPECT_THAT(parts.update({5}), ElementsAre(kf(5)));
}

TEST(LoopConsistency, TwoCandidatesAreBelievedButTheFirstCarriesTheChain) {
  Parts parts;
  for (int i = 0; i < 3; ++i) parts.update({2});  // 0, 1, 2, 3
  // Both meet the part of 2; afterwards it is the part of 0 (0, 1, 2) that is remembered, and 5
  // (3, 4, 5) does not meet it any more.
  EXPECT_THAT(parts.update({0, 5}), ElementsAre(kf(0), kf(5)));
  EXPECT_THAT(parts.update({5}), IsEmpty());
  EXPECT_THAT(parts.update({5}), IsEmpty());
}

TEST(LoopConsistency, OneCandidateMayCarrySeveralChains) {
  Parts parts;
  for (int i = 0; i < 3; ++i) parts.update({1, 4});
  // 3 meets both parts: (0, 1, 2) through 2 and (3, 4, 5).
  EXPECT_THAT(parts.update({3}), ElementsAre(kf(3)));
  // Both chains go on with its part.
  EXPECT_THAT(parts.update({0, 5}), ElementsAre(kf(0), kf(5)));
}

TEST(LoopConsistency, AChainThatWasCarriedOnKeepsItsOwnCount) {
  Parts parts;
  parts.update({4});
  parts.update({1, 4});
  parts.update({1, 4});
  // Chains: (0, 1, 2) confirmed once, (3, 4, 5) twice. 1 alone has now been proposed three times
  // after its first, had it begun with 4.
  EXPECT_THAT(parts.update({1}), IsEmpty());
  EXPECT_THAT(parts.update({1}), ElementsAre(kf(1)));
}

TEST(LoopConsistency, DeadCandidatesCountForNothing) {
  Parts parts;
  for (int i = 0; i < 3; ++i) parts.update({6});
  ASSERT_TRUE(parts.erase_keyframe(kf(6)));
  EXPECT_THAT(parts.update({6}), IsEmpty());
  EXPECT_THAT(parts.update({7}), IsEmpty());  // and broke the chain
}

TEST(LoopConsistency, KeyframesMayDieBetweenQueries) {
  Parts parts;
  for (int i = 0; i < 3; ++i) parts.update({6});
  ASSERT_TRUE(parts.erase_keyframe(kf(6)));
  EXPECT_THAT(parts.update({8}), ElementsAre(kf(8)));
}

}  // namespace
}  // namespace orbslam
