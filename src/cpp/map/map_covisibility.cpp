// SPDX-License-Identifier: BSD-3-Clause
// Map: the covisibility graph. Weights are kept symmetric: every change is made on both ends.
#include <algorithm>

#include "map/keyframe_tally.hpp"
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

  thread_local std::vector<int> counters;
  KeyFrameTally shared(counters);
  for (const MapPointId point_id : updated.map_points) {
    const MapPoint* seen = find(point_id);
    if (!seen) continue;
    for (const Observation& observation : seen->observations) {
      if (observation.keyframe != id) shared.add(observation.keyframe);
    }
  }

  // Neighbours that share no point any more get the weight 0.
  std::vector<KeyFrameId> others = shared.counted();
  for (const auto& [other, weight] : updated.weights) {
    if (shared.of(other) == 0) others.push_back(other);
  }
  std::sort(others.begin(), others.end());
  bool changed = false;
  for (const KeyFrameId other : others) {
    const int count = shared.of(other);
    KeyFrame& neighbour = keyframe(other);
    if (set_weight(updated, other, count)) {
      set_weight(neighbour, id, count);
      sort_neighbours(neighbour);
      keyframes_.touch(other);
      changed = true;
    }
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
  const KeyFrame* owner = find(id);
  if (!owner) return {};
  const auto& all = owner->neighbours;
  return {all.begin(), all.begin() + static_cast<std::ptrdiff_t>(std::min(n, all.size()))};
}

int Map::weight(KeyFrameId a, KeyFrameId b) const {
  const KeyFrame* owner = find(a);
  if (!owner) return 0;
  const auto entry = owner->weights.find(b);
  return entry == owner->weights.end() ? 0 : entry->second;
}

}  // namespace orbslam
