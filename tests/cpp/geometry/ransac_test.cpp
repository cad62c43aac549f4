// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/ransac.hpp"

#include <gtest/gtest.h>

#include <map>
#include <set>
#include <stdexcept>

namespace orbslam {
namespace {

TEST(RandomIntegers, StayBelowAndAreUniform) {
  RandomIntegers random(5);
  std::array<int, 7> counts{};
  for (int i = 0; i < 70000; ++i) {
    const std::uint64_t value = random.below(7);
    ASSERT_LT(value, 7U);
    ++counts[value];
  }
  for (const int count : counts) EXPECT_NEAR(count, 10000, 400);  // four deviations
}

TEST(RandomIntegers, AreUnbiasedForHugeRanges) {
  // Plain remainders of a range of 3/4 of 2^64 would hit the lowest third half of the time.
  RandomIntegers random(6);
  const std::uint64_t range = 0xC000000000000000ULL;
  int low = 0;
  for (int i = 0; i < 30000; ++i) low += random.below(range) < range / 3 ? 1 : 0;
  EXPECT_NEAR(low, 10000, 400);
}

TEST(RandomIntegers, AreTheSameOnEveryPlatform) {
  // The 10000th output of std::mt19937_64 is fixed by the standard for its default seed.
  RandomIntegers random(std::mt19937_64::default_seed);
  for (int i = 0; i < 9999; ++i) random.below(1ULL << 63U);
  EXPECT_EQ(random.below(1ULL << 63U), 9981545732273789042ULL % (1ULL << 63U));
}

TEST(MinimalSampler, DrawsDistinctIndicesUniformly) {
  MinimalSampler sampler(5, 1);
  std::map<std::array<int, 2>, int> counts;
  for (int i = 0; i < 40000; ++i) {
    const auto sample = sampler.draw<2>();
    ASSERT_NE(sample[0], sample[1]);
    ++counts[sample];
  }
  ASSERT_EQ(counts.size(), 20U);
  for (const auto& [sample, count] : counts) EXPECT_NEAR(count, 2000, 200);
}

TEST(MinimalSampler, DrawsAllOfASmallSet) {
  MinimalSampler sampler(4, 2);
  for (int i = 0; i < 20; ++i) {
    const auto sample = sampler.draw<4>();
    EXPECT_EQ(std::set<int>(sample.begin(), sample.end()), (std::set<int>{0, 1, 2, 3}));
  }
}

TEST(MinimalSampler, RefusesTooLargeSamples) {
  MinimalSampler sampler(3, 2);
  EXPECT_THROW(sampler.draw<4>(), std::invalid_argument);
}

// OD-66, OD-102: draws come from a generator of their own, not from one of the process.
TEST(MinimalSampler, RepeatsWithTheSeed) {
  MinimalSampler a(100, 9), b(100, 9), c(100, 10);
  bool differs = false;
  for (int i = 0; i < 50; ++i) {
    const auto sample = a.draw<8>();
    EXPECT_EQ(sample, b.draw<8>());
    differs |= sample != c.draw<8>();
  }
  EXPECT_TRUE(differs);
}

int iterations(std::size_t count, std::size_t min_inliers, double ratio, int exponent = 3) {
  return ransac_iterations(count, {0.99, min_inliers, ratio, 300, exponent});
}

TEST(RansacIterations, AreTheKnownFigures) {
  // Similarity: the ratio follows from 20 inliers.
  EXPECT_EQ(iterations(20, 20, 0), 1);
  EXPECT_EQ(iterations(40, 20, 0), 35);
  EXPECT_EQ(iterations(60, 20, 0), 123);
  EXPECT_EQ(iterations(80, 20, 0), 293);
  EXPECT_EQ(iterations(81, 20, 0), 300);
  // Pose of a camera: a ratio of at least one half.
  EXPECT_EQ(iterations(40, 20, 0.5), 35);
  EXPECT_EQ(iterations(40, 20, 0.5, 4), 72);
  EXPECT_EQ(iterations(12, 10, 0.5), 6);
}

// OD-99: no logarithm of a negative number.
TEST(RansacIterations, NoneWithTooFewCorrespondences) {
  EXPECT_EQ(iterations(9, 10, 0.5), 0);
  EXPECT_EQ(iterations(0, 0, 0.5), 0);
  EXPECT_EQ(iterations(10, 10, 0.5), 1);
  EXPECT_EQ(iterations(11, 10, 1.0), 1);
}

TEST(RansacIterations, NoAssumedInliersGiveTheLimit) { EXPECT_EQ(iterations(10, 0, 0.0), 300); }

}  // namespace
}  // namespace orbslam
