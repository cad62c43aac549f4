// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace orbslam {

/// Finds the matches whose rotation disagrees with the majority: a histogram of 12 bins of 30
/// degrees, centred on multiples of their width, of which the three fullest survive; the second and
/// the third only with at least a tenth of the fullest. See
/// docs/method/words.md#matching-by-words.
class OrientationHistogram {
 public:
  static constexpr int kBins = 12;

  /// `angle_from` is the keyframe / last / initial side; degrees.
  void add(std::uint32_t match, float angle_from, float angle_to);
  /// Matches in all other bins, ascending bin, in order of insertion.
  std::vector<std::uint32_t> inconsistent() const;
  void clear();

  /// Indices of the bins that survive, fullest first, of equal ones the lower (-1: none).
  static std::array<int, 3> fullest(const std::array<std::size_t, kBins>& counts);

 private:
  std::array<std::vector<std::uint32_t>, kBins> bins_;
};

}  // namespace orbslam
