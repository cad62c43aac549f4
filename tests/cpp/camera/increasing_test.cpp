// SPDX-License-Identifier: BSD-3-Clause
#include "camera/increasing.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace orbslam {
namespace {

TEST(SmallestPositiveRoot, IsFoundAmongOthers) {
  EXPECT_DOUBLE_EQ(smallest_positive_root({-6, 11, -6, 1}), 1);  // (t - 1)(t - 2)(t - 3)
  EXPECT_DOUBLE_EQ(smallest_positive_root({6, -1, -1}), 2);      // (2 - t)(t + 3)
  EXPECT_NEAR(smallest_positive_root({-1, 0, 0, 0, 0, 1e-10}), 100, 1e-10);
  EXPECT_DOUBLE_EQ(smallest_positive_root({1, -0.25, 0, 0}), 4);
}

TEST(SmallestPositiveRoot, IsInfiniteWithoutOne) {
  for (const std::vector<double>& one :
       {std::vector<double>{}, {1}, {1, 2}, {1, -1, 1}, {0, 1}, {1, 0, 0}}) {
    EXPECT_EQ(smallest_positive_root(one), std::numeric_limits<double>::infinity());
  }
}

TEST(InvertIncreasing, FindsTheArgumentUpToTheEnd) {
  const auto cube = [](double r) { return ValueAndSlope{r * r * r, 3 * r * r}; };
  const double endless = std::numeric_limits<double>::infinity();
  for (const double r : {1e-6, 0.3, 1.0, 5.0, 999.0}) {
    double found = 0;
    ASSERT_TRUE(invert_increasing(cube, r * r * r, endless, found));
    EXPECT_NEAR(found, r, 1e-14 * r);
    EXPECT_EQ(invert_increasing(cube, r * r * r, 1.0, found), r < 1);
  }
  double found = 0;
  EXPECT_FALSE(invert_increasing(cube, std::nan(""), endless, found));
  const auto bounded = [](double r) { return ValueAndSlope{r / (1 + r), 1 / ((1 + r) * (1 + r))}; };
  EXPECT_FALSE(invert_increasing(bounded, 1.5, endless, found));
}

}  // namespace
}  // namespace orbslam
