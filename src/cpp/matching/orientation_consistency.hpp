// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace orbslam {

/// Keeps the matches whose rotation agrees with the majority: a histogram of 12 bins of 30
/// degrees with wrap-around, of which the three fullest survive (spec 06, 1.2).
class OrientationHistogram {
 public:
  static constexpr int kBins = 12;

  /// `angle_from` is the keyframe / last / initial side; degrees.
  void add(std::uint32_t match, float angle_from, float angle_to);
  /// Matches in all other bins, ascending bin, in order of insertion.
  std::vector<std::uint32_t> inconsistent() const;
  void clear();

  /// Indices of the bins that survive (-1: none).
  static std::array<int, 3> fullest(const std::array<std::size_t, kBins>& counts);

 private:
  std::array<std::vector<std::uint32_t>, kBins> bins_;
};

}  // namespace orbslam
