// SPDX-License-Identifier: BSD-3-Clause
#include "matching/orientation_consistency.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "support/synthetic_frames.hpp"

namespace orbslam {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using Counts = std::array<std::size_t, OrientationHistogram::kBins>;

TEST(FullestBins, NoneWhenAllAreEmpty) {
  EXPECT_THAT(OrientationHistogram::fullest(Counts{}), ElementsAre(-1, -1, -1));
}

TEST(FullestBins, OneBinIsKeptAlone) {
  EXPECT_THAT(OrientationHistogram::fullest(Counts{0, 0, 0, 0, 0, 7}), ElementsAre(5, -1, -1));
}

TEST(FullestBins, OrderedBySize) {
  EXPECT_THAT(OrientationHistogram::fullest(Counts{1, 5, 3, 9, 2, 4}), ElementsAre(3, 1, 5));
}

TEST(FullestBins, LowerBinWinsTies) {
  EXPECT_THAT(OrientationHistogram::fullest(Counts{4, 4, 4, 4}), ElementsAre(0, 1, 2));
  EXPECT_THAT(OrientationHistogram::fullest(Counts{3, 4, 3, 4, 3}), ElementsAre(1, 3, 0));
}

TEST(FullestBins, ATenthOfTheFullestIsEnough) {
  EXPECT_THAT(OrientationHistogram::fullest(Counts{10, 1, 1}), ElementsAre(0, 1, 2));
  EXPECT_THAT(OrientationHistogram::fullest(Counts{300, 30, 30}), ElementsAre(0, 1, 2));
}

TEST(FullestBins, LessThanATenthIsDropped) {
  EXPECT_THAT(OrientationHistogram::fullest(Counts{11, 1, 1}), ElementsAre(0, -1, -1));
  EXPECT_THAT(OrientationHistogram::fullest(Counts{20, 5, 1}), ElementsAre(0, 1, -1));
}

// The bin of one rotation, found by the company it keeps: ten matches at `rotation` and one each
// at the middle of every other bin survive together only if they share a bin.
bool share_a_bin(float rotation, float other) {
  OrientationHistogram histogram;
  for (std::uint32_t i = 0; i < 100; ++i) histogram.add(i, rotation, 0);
  histogram.add(100, other, 0);
  return histogram.inconsistent().empty();
}

// OD-79: rotations around 0 are not split.
TEST(OrientationHistogram, BinsAreCentredOnMultiplesOfThirtyDegreesAndWrap) {
  EXPECT_TRUE(share_a_bin(0, 14.99F));
  EXPECT_FALSE(share_a_bin(0, 15));  // ties are rounded away from zero
  EXPECT_TRUE(share_a_bin(30, 15));
  EXPECT_TRUE(share_a_bin(30, 44.99F));
  EXPECT_TRUE(share_a_bin(0, 345));
  EXPECT_TRUE(share_a_bin(0, 359.9F));
  EXPECT_FALSE(share_a_bin(0, 344.9F));
  EXPECT_TRUE(share_a_bin(330, 344.9F));
}

TEST(OrientationHistogram, RotationIsFromMinusToAndNeverNegative) {
  OrientationHistogram histogram;
  for (std::uint32_t i = 0; i < 20; ++i) histogram.add(i, 10, 50);  // -40 = 320 degrees
  histogram.add(20, 350, 30);                                       // 320
  histogram.add(21, 50, 10);                                        // 40
  EXPECT_THAT(histogram.inconsistent(), ElementsAre(21));
}

TEST(OrientationHistogram, LosersAscendByBinAndKeepTheirOrder) {
  OrientationHistogram histogram;
  for (std::uint32_t i = 0; i < 50; ++i) histogram.add(i, 0, 0);
  histogram.add(70, 180, 0);
  histogram.add(61, 90, 0);
  histogram.add(60, 90, 0);
  EXPECT_THAT(histogram.inconsistent(), ElementsAre(61, 60, 70));
  histogram.clear();
  EXPECT_THAT(histogram.inconsistent(), IsEmpty());
}

// Property: what stays lies in at most three bins, each at least as full as every bin that goes.
TEST(OrientationHistogram, KeepsTheMajorityOfRandomRotations) {
  std::mt19937_64 random(7);
  for (int round = 0; round < 200; ++round) {
    OrientationHistogram histogram;
    Counts counts{};
    std::vector<std::size_t> bin_of;
    for (std::uint32_t i = 0; i < 150; ++i) {
      const double spread = testing::uniform(random) < 0.5 ? 20.0 : 360.0;
      const float from = static_cast<float>(testing::uniform(random, 0, spread));
      histogram.add(i, from, 0);
      bin_of.push_back(static_cast<std::size_t>(std::round(from / 30.0F)) % counts.size());
      ++counts[bin_of.back()];
    }
    std::vector<bool> dropped_bin(counts.size(), false);
    const auto removed = histogram.inconsistent();
    for (const auto i : removed) dropped_bin[bin_of[i]] = true;
    std::size_t expected = 0, least_kept = 150, most_dropped = 0, n_kept = 0;
    for (std::size_t bin = 0; bin < counts.size(); ++bin) {
      if (dropped_bin[bin]) {
        expected += counts[bin];
        most_dropped = std::max(most_dropped, counts[bin]);
      } else if (counts[bin] > 0) {
        least_kept = std::min(least_kept, counts[bin]);
        ++n_kept;
      }
    }
    EXPECT_EQ(removed.size(), expected);  // bins stay or go as a whole
    EXPECT_LE(n_kept, 3U);
    EXPECT_GE(least_kept, most_dropped);
  }
}

}  // namespace
}  // namespace orbslam
