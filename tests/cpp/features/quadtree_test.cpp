// SPDX-License-Identifier: BSD-3-Clause
#include "features/quadtree.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

namespace orbslam {
namespace {

std::vector<Corner> random_corners(int width, int height, int count, std::uint64_t seed) {
  std::mt19937_64 generator(seed);
  std::set<std::pair<int, int>> places;
  while (static_cast<int>(places.size()) < count) {
    const int x = static_cast<int>(generator() % static_cast<std::uint64_t>(width));
    const int y = static_cast<int>(generator() % static_cast<std::uint64_t>(height));
    places.insert({y, x});
  }
  std::vector<Corner> corners;
  for (const auto& [y, x] : places) {
    corners.push_back({static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y),
                       static_cast<std::int32_t>(7 + generator() % 60)});
  }
  return corners;
}

// OD-20: areas less than half as wide as high have a root, too.
TEST(Quadtree, KeepsDistinctCornersUpToTheQuota) {
  Quadtree quadtree;
  for (const auto& [width, height] :
       {std::pair(600, 440), std::pair(1200, 340), std::pair(80, 163), std::pair(31, 900)}) {
    for (const int count : {1, 2, 30, 1000}) {
      for (const int quota : {1, 7, 100, 5000}) {
        const auto corners = random_corners(width, height, count, 11);
        const auto kept = quadtree.distribute(corners, width, height, quota);
        const int n_roots = std::max(1, static_cast<int>(std::round(1.0 * width / height)));
        EXPECT_GE(kept.size(), 1U);
        EXPECT_LE(static_cast<int>(kept.size()), std::max(quota + 2, 4 * n_roots));
        EXPECT_LE(static_cast<int>(kept.size()), count);
        // With hardly more corners than wanted the division may stop early: no box of a pass
        // splits when all its corners lie in one quarter.
        if (2 * quota <= count) {
          EXPECT_GE(static_cast<int>(kept.size()), quota);
        }
        std::set<std::pair<int, int>> places;
        for (const Corner& corner : kept) {
          EXPECT_TRUE(places.insert({corner.x, corner.y}).second);
          EXPECT_TRUE(std::any_of(corners.begin(), corners.end(), [&](const Corner& given) {
            return given.x == corner.x && given.y == corner.y && given.response == corner.response;
          }));
        }
      }
    }
  }
}

// OD-23: a quota of 0 gives nothing.
TEST(Quadtree, NothingWithoutQuotaOrCorners) {
  Quadtree quadtree;
  EXPECT_TRUE(quadtree.distribute(random_corners(50, 50, 20, 1), 50, 50, 0).empty());
  EXPECT_TRUE(quadtree.distribute({}, 50, 50, 10).empty());
}

TEST(Quadtree, StrongestOfABoxAndFirstOfEquals) {
  Quadtree quadtree;
  // One sweep makes four boxes, last created (lower right) first.
  const std::vector<Corner> corners = {{1, 1, 10}, {2, 1, 30},  {3, 2, 30},  {90, 3, 8},
                                       {4, 95, 9}, {80, 80, 7}, {99, 99, 50}};
  const auto& kept = quadtree.distribute(corners, 100, 100, 4);
  ASSERT_EQ(kept.size(), 4U);
  EXPECT_EQ(kept[0].response, 50);
  EXPECT_EQ(kept[1].y, 95);
  EXPECT_EQ(kept[2].x, 90);
  EXPECT_EQ(kept[3].x, 2);
}

// OD-21: the order of equal boxes does not depend on their addresses.
TEST(Quadtree, AmongEqualBoxesTheLastCreatedIsDividedFirst) {
  Quadtree quadtree;
  // Four boxes of two corners each; a quota of five allows one further division, in the box
  // created last: the lower right one.
  const std::vector<Corner> corners = {{10, 10, 9}, {40, 40, 8}, {60, 10, 9}, {90, 40, 8},
                                       {10, 60, 9}, {40, 90, 8}, {60, 60, 9}, {90, 90, 8}};
  const auto& kept = quadtree.distribute(corners, 100, 100, 5);
  ASSERT_EQ(kept.size(), 5U);
  EXPECT_EQ(kept[0].x, 90);
  EXPECT_EQ(kept[0].y, 90);
  EXPECT_EQ(kept[1].x, 60);
  EXPECT_EQ(kept[1].y, 60);
}

}  // namespace
}  // namespace orbslam
