// SPDX-License-Identifier: BSD-3-Clause
#include "matching/orientation_consistency.hpp"

#include <algorithm>
#include <cmath>

namespace orbslam {
namespace {

constexpr float kBinWidth = 360.0F / OrientationHistogram::kBins;  // degrees
constexpr float kLeastShare = 0.1F;  // of the fullest bin, for the second and the third to count

}  // namespace

void OrientationHistogram::add(std::uint32_t match, float angle_from, float angle_to) {
  float rotation = angle_from - angle_to;
  if (rotation < 0.0F) rotation += 360.0F;
  // Bins are centred on multiples of their width: no rotation lies in the middle of bin 0.
  const auto bin = static_cast<std::size_t>(std::round(rotation / kBinWidth)) % kBins;
  bins_[bin].push_back(match);
}

std::vector<std::uint32_t> OrientationHistogram::inconsistent() const {
  std::array<std::size_t, kBins> counts{};
  for (std::size_t bin = 0; bin < kBins; ++bin) counts[bin] = bins_[bin].size();
  const std::array<int, 3> kept = fullest(counts);

  std::vector<std::uint32_t> removed;
  for (std::size_t bin = 0; bin < kBins; ++bin) {
    if (std::find(kept.begin(), kept.end(), static_cast<int>(bin)) != kept.end()) continue;
    removed.insert(removed.end(), bins_[bin].begin(), bins_[bin].end());
  }
  return removed;
}

void OrientationHistogram::clear() {
  for (auto& bin : bins_) bin.clear();
}

std::array<int, 3> OrientationHistogram::fullest(const std::array<std::size_t, kBins>& counts) {
  std::array<int, 3> place{-1, -1, -1};
  std::array<std::size_t, 3> count{};
  for (std::size_t bin = 0; bin < kBins; ++bin) {
    // Strictly larger, so that the lower of two equal bins keeps the better place.
    const auto rank = static_cast<std::size_t>(
        std::find_if(count.begin(), count.end(), [&](auto c) { return counts[bin] > c; }) -
        count.begin());
    if (rank == count.size()) continue;
    for (std::size_t i = count.size() - 1; i > rank; --i) {
      count[i] = count[i - 1];
      place[i] = place[i - 1];
    }
    count[rank] = counts[bin];
    place[rank] = static_cast<int>(bin);
  }
  const float least = kLeastShare * static_cast<float>(count[0]);
  if (static_cast<float>(count[1]) < least) place[1] = place[2] = -1;
  if (static_cast<float>(count[2]) < least) place[2] = -1;
  return place;
}

}  // namespace orbslam
