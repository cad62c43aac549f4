// SPDX-License-Identifier: BSD-3-Clause
#include "map/culling.hpp"

namespace orbslam {
namespace {

constexpr double kMinFoundRatio = 0.25;
constexpr std::int64_t kObservationAge = 2;  ///< keyframes after which observations are expected
constexpr std::int64_t kProbation = 3;       ///< keyframes after which a point is trusted
constexpr double kRedundantShare = 0.9;
constexpr int kOtherObservers = 3;
constexpr int kLevelSlack = 1;  ///< levels by which others may see a point at a coarser scale

enum class Verdict { kDrop, kKill, kKeep };

Verdict judge(const MapPoint& point, KeyFrameId current, int min_observations) {
  if (point.found_ratio() < kMinFoundRatio) return Verdict::kKill;
  const std::int64_t age = current.value - point.first_keyframe.value;
  if (age >= kObservationAge && point.observation_count <= min_observations) return Verdict::kKill;
  return age >= kProbation ? Verdict::kDrop : Verdict::kKeep;
}

/// Seen by enough others at the same or a finer scale, with some slack.
bool is_redundant(const Map& map, const MapPoint& point, const KeyFrame& keyframe,
                  std::size_t slot) {
  if (point.observation_count <= kOtherObservers) return false;
  const int coarsest = keyframe.frame->keypoints[slot].level + kLevelSlack;
  int n_others = 0;
  for (const Observation& observation : point.observations) {
    if (observation.keyframe == keyframe.id) continue;
    const Frame& other = *map.find(observation.keyframe)->frame;
    if (other.keypoints[observation.index].level > coarsest) continue;
    if (++n_others == kOtherObservers) return true;
  }
  return false;
}

/// Under the lock.
bool is_redundant(const Map& map, KeyFrameId id, bool only_close) {
  const KeyFrame* keyframe = map.find(id);
  if (!keyframe) return false;
  const Frame& frame = *keyframe->frame;
  int n_points = 0, n_redundant = 0;
  for (std::size_t i = 0; i < keyframe->map_points.size(); ++i) {
    const MapPoint* point = map.find(keyframe->map_points[i]);
    if (!point) continue;
    if (only_close && !frame.has_depth(i)) continue;
    if (only_close && frame.depth[i] > frame.camera->close_depth(frame.keypoints[i].x)) continue;
    ++n_points;
    n_redundant += is_redundant(map, *point, *keyframe, i) ? 1 : 0;
  }
  return n_redundant > kRedundantShare * n_points;
}

}  // namespace

int cull_recent_points(Map& map, KeyFrameId current, int min_observations,
                       std::vector<MapPointId>& recent) {
  const auto lock = map.write_lock();
  int n_killed = 0;
  std::size_t n_kept = 0;
  for (const MapPointId id : recent) {
    const MapPoint* point = map.find(id);
    if (!point) continue;
    switch (judge(*point, current, min_observations)) {
      case Verdict::kKeep:
        recent[n_kept++] = id;
        break;
      case Verdict::kKill:
        map.erase_point(id);
        ++n_killed;
        break;
      case Verdict::kDrop:
        break;
    }
  }
  recent.resize(n_kept);
  return n_killed;
}

std::vector<KeyFrameId> cull_keyframes(Map& map, KeyFrameId current, bool only_close,
                                       const std::function<bool(KeyFrameId)>& is_needed) {
  const auto may_go = [&](KeyFrameId id) {
    return is_redundant(map, id, only_close) && !(is_needed && is_needed(id));
  };
  std::vector<KeyFrameId> neighbours, died;
  {
    const auto lock = map.read_lock();
    if (const KeyFrame* keyframe = map.find(current)) neighbours = keyframe->neighbours;
  }
  for (const KeyFrameId id : neighbours) {
    {
      // Most keyframes are needed. The check runs under the read lock, so that readers do not wait.
      const auto lock = map.read_lock();
      const KeyFrame* neighbour = map.find(id);
      if (neighbour && map.is_root(*neighbour)) continue;
      if (!may_go(id)) continue;
    }
    const auto lock = map.write_lock();
    if (may_go(id) && map.erase_keyframe(id)) died.push_back(id);
  }
  return died;
}

}  // namespace orbslam
