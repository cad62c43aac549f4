// SPDX-License-Identifier: BSD-3-Clause
#include "loops/fusion_draft.hpp"

#include <algorithm>

namespace orbslam {
namespace {

bool is_observed(const std::vector<Observation>& observations, KeyFrameId keyframe) {
  const auto at = std::lower_bound(observations.begin(), observations.end(), keyframe, precedes);
  return at != observations.end() && at->keyframe == keyframe;
}

bool share_an_observer(const std::vector<Observation>& a, const std::vector<Observation>& b) {
  return std::any_of(a.begin(), a.end(),
                     [&](const Observation& seen) { return is_observed(b, seen.keyframe); });
}

}  // namespace

std::vector<KeyFrameId> neighbours_by(const SharedPoints& shared) {
  SharedPoints strong;
  std::pair<KeyFrameId, int> best{KeyFrameId(), 0};
  for (const auto& neighbour : shared) {
    if (neighbour.second >= Map::kCovisibilityThreshold) strong.push_back(neighbour);
    if (neighbour.second > best.second) best = neighbour;
  }
  if (strong.empty() && best.first.valid()) strong.push_back(best);
  std::stable_sort(strong.begin(), strong.end(),
                   [](const auto& a, const auto& b) { return a.second > b.second; });
  std::vector<KeyFrameId> ids;
  for (const auto& neighbour : strong) ids.push_back(neighbour.first);
  return ids;
}

FusionDraft::FusionDraft(const Map& map, const std::vector<KeyFrameId>& group,
                         const std::vector<MapPointId>& far) {
  for (const KeyFrameId id : group) position_of_.emplace(id, position_of_.size());
  place_of_.reset(far.size() + 1000);
  far_points_.reserve(far.size());
  for (const MapPointId id : far) {
    const MapPoint* point = map.find(id);
    if (!point || place_of_.find(id) != kNone) continue;
    copy(*point, true, carrier_outside(*point));
    far_points_.push_back(*point);
  }
  for (const KeyFrameId id : group) {
    const KeyFrame& keyframe = *map.find(id);
    GroupKeyFrame copied{id, keyframe.frame, keyframe.T_cw, {}};
    copied.slots.reserve(keyframe.map_points.size());
    for (const MapPointId seen : keyframe.map_points) {
      const MapPoint* point = map.find(seen);
      std::int32_t place = point ? place_of_.find(seen) : kNone;
      if (point && place == kNone) place = copy(*point, false, id);
      copied.slots.push_back(place);
    }
    keyframes_.push_back(std::move(copied));
  }
}

std::int32_t FusionDraft::copy(const MapPoint& point, bool far, KeyFrameId carrier) {
  const auto place = static_cast<std::int32_t>(points_.size());
  points_.push_back({point.id, far, kNone, carrier, point.observations});
  place_of_.insert(point.id, place);
  return place;
}

KeyFrameId FusionDraft::carrier_outside(const MapPoint& point) const {
  if (position_of_.count(point.reference_keyframe) == 0) return point.reference_keyframe;
  for (const Observation& observation : point.observations) {
    if (position_of_.count(observation.keyframe) == 0) return observation.keyframe;
  }
  return point.reference_keyframe;
}

KeyFrameId FusionDraft::carrier(MapPointId id) const {
  const std::int32_t place = place_of_.find(id);
  return place == kNone ? KeyFrameId() : points_[static_cast<std::size_t>(place)].carrier;
}

std::int32_t FusionDraft::resolve(MapPointId id) const {
  std::int32_t place = place_of_.find(id);
  while (place != kNone && points_[static_cast<std::size_t>(place)].successor != kNone) {
    place = points_[static_cast<std::size_t>(place)].successor;
  }
  return place;
}

void FusionDraft::observe(Point& point, KeyFrameId keyframe, std::uint32_t keypoint) {
  auto& all = point.observations;
  all.insert(std::lower_bound(all.begin(), all.end(), keyframe, precedes),
             {keyframe, keypoint, false});
}

void FusionDraft::set_slot(KeyFrameId keyframe, std::uint32_t keypoint, std::int32_t point) {
  const auto member = position_of_.find(keyframe);
  if (member != position_of_.end()) keyframes_[member->second].slots[keypoint] = point;
}

// As Map::replace_point().
void FusionDraft::replace(std::int32_t place, std::int32_t by) {
  Point& dying = points_[static_cast<std::size_t>(place)];
  Point& survivor = points_[static_cast<std::size_t>(by)];
  for (const Observation& observation : dying.observations) {
    const bool twice = is_observed(survivor.observations, observation.keyframe);
    if (!twice) observe(survivor, observation.keyframe, observation.index);
    set_slot(observation.keyframe, observation.index, twice ? kNone : by);
  }
  dying.observations.clear();
  dying.successor = by;
}

void FusionDraft::fuse(std::size_t k, std::uint32_t keypoint, MapPointId far_point) {
  const std::int32_t place = resolve(far_point);
  if (place == kNone) return;
  GroupKeyFrame& keyframe = keyframes_[k];
  Point& point = points_[static_cast<std::size_t>(place)];
  if (is_observed(point.observations, keyframe.id)) return;
  const std::int32_t present = keyframe.slots[keypoint];
  if (present == kNone) {
    observe(point, keyframe.id, keypoint);
    keyframe.slots[keypoint] = place;
    fusions_.push_back({point.id, MapPointId(), keyframe.id, keypoint});
    return;
  }
  const Point& there = points_[static_cast<std::size_t>(present)];
  if (there.far && share_an_observer(there.observations, point.observations)) return;
  replace(present, place);
  fusions_.push_back({point.id, there.id, keyframe.id, keypoint});
}

std::vector<SharedPoints> FusionDraft::shared_points() const {
  std::int64_t last = -1;
  for (const Point& point : points_) {
    if (!point.observations.empty()) {
      last = std::max(last, point.observations.back().keyframe.value);
    }
  }
  std::vector<int> counts(static_cast<std::size_t>(last + 1), 0);  // all zero between keyframes
  std::vector<SharedPoints> shared;
  std::vector<KeyFrameId> counted;
  for (const GroupKeyFrame& keyframe : keyframes_) {
    counted.clear();
    for (const std::int32_t place : keyframe.slots) {
      if (place == kNone) continue;
      for (const Observation& seen : points_[static_cast<std::size_t>(place)].observations) {
        if (seen.keyframe == keyframe.id) continue;
        if (counts[static_cast<std::size_t>(seen.keyframe.value)]++ == 0) {
          counted.push_back(seen.keyframe);
        }
      }
    }
    std::sort(counted.begin(), counted.end());
    SharedPoints& of_this = shared.emplace_back();
    for (const KeyFrameId other : counted) {
      int& count = counts[static_cast<std::size_t>(other.value)];
      of_this.emplace_back(other, count);
      count = 0;
    }
  }
  return shared;
}

int carry_out(const std::vector<LoopCorrection::Fusion>& fusions, std::size_t first,
              std::size_t last, Map& map, std::vector<MapPointId>& added) {
  int n_fused = 0;
  for (std::size_t i = first; i < last; ++i) {
    const LoopCorrection::Fusion& fusion = fusions[i];
    const MapPointId survivor = map.resolve(fusion.point);
    const MapPoint* point = map.find(survivor);
    if (!point) continue;
    if (fusion.replaced.valid()) {
      const MapPointId replaced = map.resolve(fusion.replaced);
      if (!replaced.valid() || replaced == survivor) continue;
      map.replace_point(replaced, survivor);
    } else {
      const KeyFrame* keyframe = map.find(fusion.keyframe);
      if (!keyframe || map.find(keyframe->map_points[fusion.keypoint]) ||
          point->observation_of(fusion.keyframe)) {
        continue;
      }
      map.add_observation(survivor, fusion.keyframe, fusion.keypoint);
      added.push_back(survivor);
    }
    ++n_fused;
  }
  return n_fused;
}

}  // namespace orbslam
