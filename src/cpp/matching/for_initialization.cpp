// SPDX-License-Identifier: BSD-3-Clause
#include "matching/for_initialization.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "base/errors.hpp"
#include "matching/by_projection.hpp"
#include "matching/orientation_consistency.hpp"

namespace orbslam {
namespace {

constexpr int kInfinite = std::numeric_limits<int>::max();

// A candidate of match_views: distance of descriptors, index in the current frame.
using Candidate = std::pair<int, std::uint32_t>;

/// The best candidate, if no candidate at another place is nearly as similar; otherwise -1.
int clear_winner(const std::vector<Candidate>& rated, const Frame& current, float ratio) {
  if (rated.empty()) return -1;
  const Candidate best = *std::min_element(rated.begin(), rated.end());
  if (best.first > kDescriptorLow) return -1;
  const Keypoint& at = current.keypoints[best.second];
  constexpr float kSamePlace = 2;
  const float near = kSamePlace * current.scales->scale(at.level);
  for (const auto& [distance, index] : rated) {
    if (static_cast<float>(best.first) < ratio * static_cast<float>(distance)) continue;
    const Keypoint& other = current.keypoints[index];
    if (std::max(std::abs(other.x - at.x), std::abs(other.y - at.y)) > near) return -1;
  }
  return static_cast<int>(best.second);
}

void check_expected(const Frame& first, const std::vector<Eigen::Vector2f>& expected) {
  if (expected.size() == first.size()) return;
  throw StateError("match_views: " + std::to_string(expected.size()) +
                   " expected positions, the first frame has " + std::to_string(first.size()) +
                   " keypoints; pass one position per keypoint");
}

}  // namespace

std::vector<int> match_views(const Frame& first, const Frame& current,
                             const std::vector<Eigen::Vector2f>& expected,
                             const ViewMatchOptions& options) {
  check_expected(first, expected);
  std::vector<int> matches(first.size(), -1);
  std::vector<int> partner(current.size(), -1);
  std::vector<int> accepted_distance(current.size(), kInfinite);
  std::vector<std::uint32_t> candidates;
  std::vector<Candidate> rated;
  OrientationHistogram rotations;
  for (std::size_t i = 0; i < first.size(); ++i) {
    const int level = first.keypoints[i].level;
    if (level > options.highest_level) continue;
    current.grid.features_in_area(current.keypoints, expected[i].x(), expected[i].y(),
                                  options.window, std::max(0, level - options.level_difference),
                                  level + options.level_difference, candidates);
    rated.clear();
    for (const std::uint32_t candidate : candidates) {
      const int distance = hamming_distance(first.descriptors[i], current.descriptors[candidate]);
      if (distance < accepted_distance[candidate]) rated.emplace_back(distance, candidate);
    }
    const int found = clear_winner(rated, current, options.ratio);
    if (found < 0) continue;
    const auto match = static_cast<std::size_t>(found);
    if (partner[match] >= 0) matches[static_cast<std::size_t>(partner[match])] = -1;
    partner[match] = static_cast<int>(i);
    accepted_distance[match] = hamming_distance(first.descriptors[i], current.descriptors[match]);
    matches[i] = found;
    rotations.add(static_cast<std::uint32_t>(i), first.keypoints[i].angle,
                  current.keypoints[match].angle);
  }
  for (const std::uint32_t i : rotations.inconsistent()) matches[i] = -1;
  return matches;
}

}  // namespace orbslam
