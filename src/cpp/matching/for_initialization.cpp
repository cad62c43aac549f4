// SPDX-License-Identifier: BSD-3-Clause
#include "matching/for_initialization.hpp"

#include <limits>
#include <string>

#include "base/errors.hpp"
#include "matching/by_projection.hpp"
#include "matching/orientation_consistency.hpp"

namespace orbslam {
namespace {

constexpr int kInfinite = std::numeric_limits<int>::max();

struct BestTwo {
  int index = -1;
  int best = kInfinite;
  int second = kInfinite;
};

// Candidates that already have an at least equally good partner do not compete.
BestTwo find_best(const Descriptor& wanted, const Frame& current,
                  const std::vector<std::uint32_t>& candidates,
                  const std::vector<int>& accepted_distance) {
  BestTwo found;
  for (const std::uint32_t candidate : candidates) {
    const int distance = hamming_distance(wanted, current.descriptors[candidate]);
    if (accepted_distance[candidate] <= distance) continue;
    if (distance < found.best) {
      found.second = found.best;
      found.best = distance;
      found.index = static_cast<int>(candidate);
    } else if (distance < found.second) {
      found.second = distance;
    }
  }
  return found;
}

}  // namespace

std::vector<int> match_for_initialization(const Frame& initial, const Frame& current,
                                          std::vector<Eigen::Vector2f>& previous, float window,
                                          float ratio) {
  if (previous.size() != initial.size()) {
    throw StateError("match_for_initialization: previous has " + std::to_string(previous.size()) +
                     " positions, the initial frame " + std::to_string(initial.size()) +
                     " keypoints; pass one position per keypoint");
  }
  std::vector<int> matches(initial.size(), -1);
  std::vector<int> partner(current.size(), -1);
  std::vector<int> accepted_distance(current.size(), kInfinite);
  std::vector<std::uint32_t> candidates;
  OrientationHistogram rotations;

  for (std::size_t i = 0; i < initial.size(); ++i) {
    if (initial.keypoints[i].level > 0) continue;
    current.grid.features_in_area(current.keypoints, previous[i].x(), previous[i].y(), window, 0, 0,
                                  candidates);
    const BestTwo found = find_best(initial.descriptors[i], current, candidates, accepted_distance);
    if (found.best > kDescriptorLow ||
        static_cast<float>(found.best) >= ratio * static_cast<float>(found.second)) {
      continue;
    }
    const auto match = static_cast<std::size_t>(found.index);
    if (partner[match] >= 0) matches[static_cast<std::size_t>(partner[match])] = -1;
    partner[match] = static_cast<int>(i);
    accepted_distance[match] = found.best;
    matches[i] = found.index;
    rotations.add(static_cast<std::uint32_t>(i), initial.keypoints[i].angle,
                  current.keypoints[match].angle);
  }

  for (const std::uint32_t i : rotations.inconsistent()) matches[i] = -1;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (matches[i] < 0) continue;
    const Keypoint& match = current.keypoints[static_cast<std::size_t>(matches[i])];
    previous[i] = {match.x, match.y};
  }
  return matches;
}

}  // namespace orbslam
