// SPDX-License-Identifier: BSD-3-Clause
#include "loops/loop_detection.hpp"

#include <algorithm>
#include <utility>

namespace orbslam {
namespace {

bool share_a_keyframe(const std::vector<KeyFrameId>& a, const std::vector<KeyFrameId>& b) {
  auto i = a.begin(), j = b.begin();
  while (i != a.end() && j != b.end()) {
    if (*i == *j) return true;
    *i < *j ? ++i : ++j;
  }
  return false;
}

/// The candidate and all keyframes that share points with it, ascending.
std::vector<KeyFrameId> part_of_map(const KeyFrame& candidate) {
  std::vector<KeyFrameId> members;
  members.reserve(candidate.weights.size() + 1);
  for (const auto& [neighbour, weight] : candidate.weights) members.push_back(neighbour);
  members.insert(std::lower_bound(members.begin(), members.end(), candidate.id), candidate.id);
  return members;
}

}  // namespace

std::vector<KeyFrameId> LoopConsistency::update(const Map& map,
                                                const std::vector<KeyFrameId>& candidates) {
  std::vector<std::pair<KeyFrameId, std::vector<KeyFrameId>>> parts;
  {
    const auto lock = map.read_lock();
    for (const KeyFrameId id : candidates) {
      if (const KeyFrame* candidate = map.find(id)) parts.emplace_back(id, part_of_map(*candidate));
    }
  }
  std::vector<KeyFrameId> confirmed;
  std::vector<Group> groups;
  std::vector<std::uint8_t> continued(groups_.size(), 0);
  for (const auto& [id, members] : parts) {
    bool begins = true, accepted = false;
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      if (!share_a_keyframe(members, groups_[g].members)) continue;
      begins = false;
      const int confirmations = groups_[g].confirmations + 1;
      accepted = accepted || confirmations >= kNeeded;
      // A chain is continued once, but a second candidate may also use its length.
      if (continued[g]) continue;
      continued[g] = 1;
      groups.push_back({members, confirmations});
    }
    if (begins) groups.push_back({members, 0});
    if (accepted) confirmed.push_back(id);
  }
  groups_ = std::move(groups);
  return confirmed;
}

}  // namespace orbslam
