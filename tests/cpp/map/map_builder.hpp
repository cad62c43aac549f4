// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "map/invariants.hpp"
#include "map/map.hpp"
#include "support/synthetic_frames.hpp"

namespace orbslam::testing {

/// Builds small maps slot by slot. Keyframe k stands at x = k metres and looks along z.
class MapBuilder {
 public:
  static constexpr std::size_t kSlots = 400;

  Map map;

  KeyFrameId add_keyframe(bool publish = true, std::size_t n_slots = kSlots, float depth = -1,
                          std::int32_t level = 0) {
    const auto k = static_cast<std::int64_t>(map.keyframe_ids().size() + n_dead_);
    const Eigen::Vector3d center(static_cast<double>(k), 0, 0);
    const KeyFrameId id = map.add_keyframe(
        make_raster_frame(k, n_slots, depth, level, synthetic_camera(), static_cast<unsigned>(k)),
        Pose(Eigen::Quaterniond::Identity(), -center));
    if (publish) map.publish(id);
    return id;
  }
  void add_keyframes(int n) {
    for (int i = 0; i < n; ++i) add_keyframe();
  }

  /// A point at (0, 0, 5) observed in the next free slot of each keyframe; the first one is the
  /// reference.
  MapPointId add_point(const std::vector<KeyFrameId>& observers) {
    const MapPointId id = map.add_point({0, 0, 5}, observers.front(), 0);
    for (const KeyFrameId observer : observers) {
      map.add_observation(id, observer, next_slot_[observer]++);
    }
    map.update_point(id);
    return id;
  }
  std::vector<MapPointId> add_points(int n, const std::vector<KeyFrameId>& observers) {
    std::vector<MapPointId> ids;
    for (int i = 0; i < n; ++i) ids.push_back(add_point(observers));
    return ids;
  }
  std::size_t next_slot(KeyFrameId id) const {
    const auto found = next_slot_.find(id);
    return found == next_slot_.end() ? 0 : found->second;
  }

  bool erase_keyframe(KeyFrameId id) {
    const bool died = map.erase_keyframe(id);
    n_dead_ += died ? 1 : 0;
    return died;
  }

  /// All violated invariants in one text, for messages of failing tests.
  std::string violations() const {
    std::string text;
    for (const std::string& violation : check_invariants(map, false)) text += violation + "\n";
    return text;
  }

 private:
  std::map<KeyFrameId, std::size_t> next_slot_;
  std::size_t n_dead_ = 0;
};

inline KeyFrameId kf(std::int64_t id) { return KeyFrameId(id); }
inline std::vector<KeyFrameId> kfs(const std::vector<std::int64_t>& ids) {
  std::vector<KeyFrameId> result;
  for (const std::int64_t id : ids) result.emplace_back(id);
  return result;
}

/// A frame with the points associated to its first keypoints.
inline TrackedFrame frame_seeing(const Map& map, const std::vector<MapPointId>& points,
                                 FrameId id = 1000) {
  TrackedFrame frame(make_raster_frame(id, points.size()));
  frame.T_cw = Pose();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const MapPoint* point = map.find(points[i]);
    frame.associate(i, points[i], point ? point->position : Eigen::Vector3d::Zero());
  }
  return frame;
}

}  // namespace orbslam::testing
