// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/motion_choice.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace orbslam {
namespace {

using Scores = std::vector<MotionScore>;
using Outcome = TwoViewOutcome;

Outcome by_homography(const Scores& scores, std::size_t n_inliers, MotionLimits limits = {}) {
  return choose_homography_motion(scores, n_inliers, limits).outcome;
}

Outcome by_fundamental(const Scores& scores, std::size_t n_inliers, MotionLimits limits = {}) {
  return choose_fundamental_motion(scores, n_inliers, limits).outcome;
}

TEST(ChooseHomographyMotion, SecondBestMustStayBelowThreeQuarters) {
  EXPECT_EQ(by_homography({{100, 2}, {74, 2}}, 100), Outcome::reconstructed);
  EXPECT_EQ(by_homography({{100, 2}, {75, 2}}, 100), Outcome::ambiguous_motion);
  EXPECT_EQ(by_homography({{100, 2}, {100, 3}}, 100), Outcome::ambiguous_motion);
}

TEST(ChooseHomographyMotion, Limits) {
  EXPECT_EQ(by_homography({{51, 1}, {0, 0}}, 51), Outcome::reconstructed);
  EXPECT_EQ(by_homography({{50, 1}, {0, 0}}, 50), Outcome::too_few_points);
  EXPECT_EQ(by_homography({{90, 1}, {0, 0}}, 100), Outcome::too_few_points);
  EXPECT_EQ(by_homography({{91, 1}, {0, 0}}, 100), Outcome::reconstructed);
  EXPECT_EQ(by_homography({{91, 0.999}, {0, 0}}, 100), Outcome::low_parallax);
  EXPECT_EQ(by_homography({{91, 0.999}, {91, 0.5}}, 100), Outcome::low_parallax);
  EXPECT_EQ(by_homography({{40, 1}, {0, 0}}, 40, {39, 1}), Outcome::reconstructed);
  EXPECT_EQ(by_homography({{91, 0.6}, {0, 0}}, 100, {50, 0.5}), Outcome::reconstructed);
}

TEST(ChooseFundamentalMotion, NoOtherAboveSeventyPercent) {
  EXPECT_EQ(by_fundamental({{100, 2}, {70, 2}, {0, 0}, {70, 1}}, 100), Outcome::reconstructed);
  EXPECT_EQ(by_fundamental({{100, 2}, {71, 2}, {0, 0}, {0, 0}}, 100), Outcome::ambiguous_motion);
}

TEST(ChooseFundamentalMotion, Limits) {
  EXPECT_EQ(by_fundamental({{50, 1.01}, {0, 0}}, 50), Outcome::reconstructed);
  EXPECT_EQ(by_fundamental({{49, 1.01}, {0, 0}}, 49), Outcome::too_few_points);
  EXPECT_EQ(by_fundamental({{90, 1.01}, {0, 0}}, 101), Outcome::reconstructed);  // 90.9 rounds down
  EXPECT_EQ(by_fundamental({{89, 1.01}, {0, 0}}, 101), Outcome::too_few_points);
  EXPECT_EQ(by_fundamental({{90, 1.0}, {0, 0}}, 100), Outcome::low_parallax);
}

TEST(ChooseMotion, OrderOfHypothesesOnlyMovesTheIndex) {
  Scores scores{{100, 2}, {60, 1}, {3, 5}, {0, 0}};
  const auto by_count = [](const MotionScore& a, const MotionScore& b) {
    return a.n_good < b.n_good;
  };
  std::sort(scores.begin(), scores.end(), by_count);
  do {
    for (const auto choose : {choose_homography_motion, choose_fundamental_motion}) {
      const MotionChoice choice = choose(scores, 105, {});
      EXPECT_EQ(choice.outcome, Outcome::reconstructed);
      EXPECT_EQ(scores[choice.index].n_good, 100U);
    }
  } while (std::next_permutation(scores.begin(), scores.end(), by_count));
  EXPECT_EQ(choose_fundamental_motion({{9, 0}, {10, 0}, {10, 0}}, 10, {}).index, 1U);
}

TEST(TwoViewOutcome, HasNames) {
  EXPECT_STREQ(to_string(Outcome::reconstructed), "reconstructed");
  EXPECT_STREQ(to_string(Outcome::ambiguous_motion), "ambiguous_motion");
}

}  // namespace
}  // namespace orbslam
