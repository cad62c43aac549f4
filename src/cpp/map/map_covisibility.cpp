// SPDX-License-Identifier: BSD-3-Clause
// Map: the covisibility graph. Weights are kept symmetric: every change is made on both ends.
#include <algorithm>

#include "map/map.hpp"

namespace orbslam {
namespace {

struct WeightedKeyFrame {
  int weight;
  KeyFrameId id;
};

bool stronger(const WeightedKeyFrame& a, const WeightedKeyFrame& b) {
  return a.weight != b.weight ? a.weight > b.weight : a.id < b.id;
}

}  // namespace

bool Map::set_weight(KeyFrame& owner, KeyFrameId other, int weight) {
  if (weight <= 0) return owner.weights.erase(other) > 0;
  const auto [entry, inserted] = owner.weights.try_emplace(other, weight);
  if (!inserted && entry->second == weight) return false;
  entry->second = weight;
  return true;
}

void Map::sort_neighbours(KeyFrame& owner) {
  thread_local std::vector<WeightedKeyFrame> strong;
  strong.clear();
  WeightedKeyFrame best{0, KeyFrameId()};
  for (const auto& [id, weight] : owner.weights) {
    if (weight >= kCovisibilityThreshold) strong.push_back({weight, id});
    if (weight > best.weight) best = {weight, id};
  }
  if (strong.empty() && best.id.valid()) strong.push_back(best);
  std::sort(strong.begin(), strong.end(), stronger);
  owner.neighbours.resize(strong.size());
  std::transform(strong.begin(), strong.end(), owner.neighbours.begin(),
                 [](const WeightedKeyFrame& neighbour) { return neighbour.id; });
}

void Map::update_connections(KeyFrameId id) {
  KeyFrame& updated = keyframe(id);

  thread_local std::vector<int> shared;  // per keyframe id; all zero between calls
  thread_local std::vector<KeyFrameId> counted;
  shared.resize(static_cast<std::size_t>(next_keyframe_.value), 0);
  counted.clear();
  for (const MapPointId point_id : updated.map_points) {
    const MapPoint* seen = find(point_id);
    if (!seen) continue;
    for (const Observation& observation : seen->observations) {
      if (observation.keyframe == id) continue;
      int& count = shared[static_cast<std::size_t>(observation.keyframe.value)];
      if (count++ == 0) counted.push_back(observation.keyframe);
    }
  }

  // Neighbours that share nothing any more get the weight 0 along with the others.
  for (const auto& [other, weight] : updated.weights) {
    if (shared[static_cast<std::size_t>(other.value)] == 0) counted.push_back(other);
  }
  std::sort(counted.begin(), counted.end());
  bool changed = false;
  for (const KeyFrameId other : counted) {
    int& count = shared[static_cast<std::size_t>(other.value)];
    KeyFrame& neighbour = keyframe(other);
    if (set_weight(updated, other, count)) {
      set_weight(neighbour, id, count);
      sort_neighbours(neighbour);
      keyframes_.touch(other);
      changed = true;
    }
    count = 0;
  }
  if (changed) {
    sort_neighbours(updated);
    keyframes_.touch(id);
    ++structure_version_;
  }
  if (!is_root(updated) && (!updated.parent.valid() || updated.provisional_parent)) {
    choose_parent(updated);
  }
}

void Map::forget_covisibility(KeyFrame& dying) {
  for (const auto& [other, weight] : dying.weights) {
    KeyFrame& neighbour = changing(other);
    neighbour.weights.erase(dying.id);
    sort_neighbours(neighbour);
  }
  dying.weights.clear();
  dying.neighbours.clear();
}

std::vector<KeyFrameId> Map::best_neighbours(KeyFrameId id, std::size_t n) const {
  const auto& all = keyframe(id).neighbours;
  return {all.begin(), all.begin() + static_cast<std::ptrdiff_t>(std::min(n, all.size()))};
}

std::vector<KeyFrameId> Map::neighbours_by_weight(KeyFrameId id, int w) const {
  const KeyFrame& owner = keyframe(id);
  const auto end =
      std::find_if(owner.neighbours.begin(), owner.neighbours.end(),
                   [&](KeyFrameId neighbour) { return owner.weights.at(neighbour) < w; });
  return {owner.neighbours.begin(), end};
}

int Map::weight(KeyFrameId a, KeyFrameId b) const {
  const KeyFrame* owner = find(a);
  if (!owner) return 0;
  const auto entry = owner->weights.find(b);
  return entry == owner->weights.end() ? 0 : entry->second;
}

}  // namespace orbslam
