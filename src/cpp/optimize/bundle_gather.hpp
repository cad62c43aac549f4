// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "map/map.hpp"
#include "optimize/bundle_adjustment.hpp"

namespace orbslam {

/// Source of the position of an observation.
enum class ObservationKind : std::uint8_t {
  kKeypoint,      ///< the corner
  kAligned,       ///< alignment of the patch; the right column has the noise of the corner
  kAlignedRight,  ///< alignment of the patch, also in the right image
  kReference,     ///< the corner from which the patch was cut
};

/// Part of a map, copied into a BundleProblem, with the ids of its objects. Filled under the map's
/// read lock, solved without a lock, committed under the write lock. See
/// docs/method/adjustment.md#local-bundle-adjustment.
struct GatheredBundle {
  BundleProblem problem;
  std::vector<KeyFrameId> keyframes;     ///< per camera of the problem
  std::vector<MapPointId> points;        ///< per point
  std::vector<std::uint32_t> keypoints;  ///< per observation: slot of its keyframe
  std::vector<ObservationKind> kinds;    ///< per observation: source of its position
  std::uint64_t epoch = 0;               ///< of the map when it was gathered
  std::uint64_t big_changes = 0;         ///< Map::big_change_index() then
  MapIndex map_index = kNoMap;           ///< of a full bundle: the map that it is of
  bool solved = false;  ///< the parameters are a result with a lower cost than the gathered ones
  std::unordered_map<KeyFrameId, std::uint32_t> camera_of;  ///< for look-ups only

  explicit GatheredBundle(const Map& map)
      : epoch(map.epoch()), big_changes(map.big_change_index()) {}

  void add_camera(const KeyFrame& keyframe, bool fixed);
  /// The point with its observations by the cameras added so far.
  void add_point(const MapPoint& point, const Map& map);
  /// Many points, after all cameras.
  void add_points(const std::vector<const MapPoint*>& added, const Map& map);
  int n_fixed() const;
};

/// Writes poses of free cameras and positions of points that still live, and refreshes the points'
/// geometry. The caller holds the write lock and has compared epochs.
void write_back(const GatheredBundle& bundle, Map& map);

/// Erases the flagged observations that are still there. Returns how many. Same conditions.
int erase_observations(const GatheredBundle& bundle, const std::vector<std::uint8_t>& flags,
                       Map& map);

}  // namespace orbslam
