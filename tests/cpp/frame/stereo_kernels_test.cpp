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

TEST(ShiftedSad, PortableVersionFollowsTheDefinition) {
  std::mt19937_64 generator(1);
  const WindowPair windows = random_windows(generator, false);
  Sums sums{};
  shifted_sad_portable(windows, sums.data());
  for (int k = 0; k < kShifts; ++k) {
    int expected = 0;
    for (int j = 0; j < 11; ++j) {
      for (int i = 0; i < 11; ++i) {
        expected += std::abs((windows.left[j][i] - windows.left[5][5]) -
                             (windows.right[j][k + i] - windows.right[5][k + 5]));
      }
    }
    EXPECT_EQ(sums[static_cast<std::size_t>(k)], expected);
  }
}

TEST(ShiftedSad, AVX2GivesTheSameSums) {
#if defined(__x86_64__)
  if (!__builtin_cpu_supports("avx2")) GTEST_SKIP() << "this CPU has no AVX2";
  std::mt19937_64 generator(2);
  for (int round = 0; round < 2000; ++round) {
    const WindowPair windows = random_windows(generator, round % 2 == 1);
    Sums portable{}, avx2{};
    shifted_sad_portable(windows, portable.data());
    shifted_sad_avx2(windows, avx2.data());
    ASSERT_EQ(portable, avx2) << "round " << round;
  }
#else
  GTEST_SKIP() << "not an x86-64 processor";
#endif
}

TEST(ShiftedSad, LargestPossibleSumIsExact) {
  WindowPair windows{};
  for (auto& row : windows.left) std::fill(std::begin(row), std::end(row), 255);
  windows.left[5][5] = 0;
  for (int k = 0; k < kShifts; ++k) windows.right[5][k + 5] = 255;
  Sums sums{}, portable{};
  best_shifted_sad()(windows, sums.data());
  shifted_sad_portable(windows, portable.data());
  EXPECT_EQ(sums, portable);
  EXPECT_GT(*std::max_element(sums.begin(), sums.end()), 110 * 510);
}

}  // namespace
}  // namespace orbslam::stereo
