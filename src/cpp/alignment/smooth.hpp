// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace orbslam::alignment {

/// Smooths with the binomial filter (1 2 1) x (1 2 1): out[y][x] is 16 times the smoothed value of
/// pixel (x + 1, y + 1) of the bytes. `bytes` has kSize + 2 rows of kSize + 2 readable pixels.
/// Integers, so that all vector units give the same numbers.
template <int kSize, class Row>
void smooth(const std::uint8_t* bytes, std::ptrdiff_t stride, std::array<Row, kSize>& out) {
  std::uint16_t across[kSize + 2][kSize];
  for (int y = 0; y < kSize + 2; ++y) {
    const std::uint8_t* row = bytes + y * stride;
    for (int x = 0; x < kSize; ++x) {
      across[y][x] = static_cast<std::uint16_t>(row[x] + 2 * row[x + 1] + row[x + 2]);
    }
  }
  for (int y = 0; y < kSize; ++y) {
    auto& row = out[static_cast<std::size_t>(y)];
    for (int x = 0; x < kSize; ++x) {
      const auto sum = across[y][x] + 2 * across[y + 1][x] + across[y + 2][x];
      row[static_cast<std::size_t>(x)] = static_cast<typename Row::value_type>(sum);
    }
  }
}

}  // namespace orbslam::alignment
