// SPDX-License-Identifier: BSD-3-Clause
#include "frame/stereo_kernels.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <random>

namespace orbslam::stereo {
namespace {

using Sums = std::array<int, kShifts>;

// With `extremes` only 0 and 255, which make the largest sums.
WindowPair random_windows(std::mt19937_64& generator, bool extremes) {
  WindowPair windows;
  const auto draw = [&]() {
    const auto value = static_cast<unsigned char>(generator() >> 56U);
    return extremes ? static_cast<unsigned char>(value & 1U ? 255 : 0) : value;
  };
  for (auto& row : windows.left) {
    for (auto& pixel : row) pixel = draw();
  }
  for (auto& row : windows.right) {
    for (auto& pixel : row) pixel = draw();
  }
  return windows;
}

Sums sums_by_definition(const WindowPair& windows) {
  Sums sums{};
  for (int k = 0; k < kShifts; ++k) {
    for (int j = 0; j < 11; ++j) {
      for (int i = 0; i < 11; ++i) {
        sums[static_cast<std::size_t>(k)] +=
            std::abs((windows.left[j][i] - windows.left[5][5]) -
                     (windows.right[j][k + i] - windows.right[5][k + 5]));
      }
    }
  }
  return sums;
}

TEST(ShiftedSad, EachUnitFollowsTheDefinition) {
  for (const VectorUnit unit : vector_units()) {
    SCOPED_TRACE(name_of(unit));
    std::mt19937_64 generator(2);
    for (int round = 0; round < 500; ++round) {
      const WindowPair windows = random_windows(generator, round % 2 == 1);
      Sums sums{};
      shifted_sad_for(unit)(windows, sums.data());
      ASSERT_EQ(sums, sums_by_definition(windows)) << "round " << round;
    }
  }
}

TEST(ShiftedSad, LargestPossibleSumIsExact) {
  WindowPair windows{};
  for (auto& row : windows.left) std::fill(std::begin(row), std::end(row), 255);
  windows.left[5][5] = 0;
  for (int k = 0; k < kShifts; ++k) windows.right[5][k + 5] = 255;
  for (const VectorUnit unit : vector_units()) {
    SCOPED_TRACE(name_of(unit));
    Sums sums{};
    shifted_sad_for(unit)(windows, sums.data());
    EXPECT_EQ(sums, sums_by_definition(windows));
    EXPECT_GT(*std::max_element(sums.begin(), sums.end()), 110 * 510);
  }
}

}  // namespace
}  // namespace orbslam::stereo
