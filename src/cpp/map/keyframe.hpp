// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <memory>
#include <set>
#include <vector>

#include "base/ids.hpp"
#include "base/pose.hpp"
#include "frame/frame.hpp"
#include "map/point_patch.hpp"

namespace orbslam {

/// A frame stored in the map. `frame` never changes and may be read without a lock once the pointer
/// has been copied; the rest belongs to the Map and is read and written under its lock. See
/// docs/method/map.md#keyframes.
struct KeyFrame {
  KeyFrameId id;
  std::shared_ptr<const Frame> frame;
  MapIndex map = 0;  ///< the map that it belongs to; its world is that of T_cw
  Pose T_cw;
  /// By how much lengths around the keyframe have been multiplied since it was made: loops closed
  /// with a single camera take out a drift of scale. Lengths kept outside the map (the poses of
  /// frames relative to this keyframe) are to follow.
  double scale = 1;
  std::vector<MapPointId> map_points;  ///< per keypoint: the observed point or an invalid id

  /// Per keypoint the result of alignment, or empty. An entry is valid while its point is in the
  /// slot.
  std::vector<AlignedSighting> aligned;

  /// Number of shared points per neighbour, all neighbours, symmetric.
  std::map<KeyFrameId, int> weights;
  /// Neighbours sharing at least Map::kCovisibilityThreshold points (or the single best one),
  /// by descending weight, ties by lower id.
  std::vector<KeyFrameId> neighbours;

  KeyFrameId parent;                ///< spanning tree; invalid for roots and before publication
  bool provisional_parent = false;  ///< parent by order in time only; a covisible one replaces it
  std::set<KeyFrameId> children;
  std::set<KeyFrameId> loop_edges;

  bool published = false;  ///< part of the map's keyframe set
  bool processed = false;  ///< local mapping has processed it (process_new_keyframe)
  int leases = 0;          ///< while > 0 a death is deferred (loop closing works on it)
  bool to_be_erased = false;

  /// The aligned observation of a slot; null if the observation uses the keypoint's own pixel.
  const AlignedSighting* aligned_at(std::size_t index, MapPointId point) const {
    const bool is_aligned =
        !aligned.empty() && aligned[index].point == point && aligned[index].ok();
    return is_aligned ? &aligned[index] : nullptr;
  }

  Eigen::Vector3d center() const { return T_cw.center(); }
  /// Centre (world) of the camera that a keypoint belongs to; differs from center() for a rig.
  Eigen::Vector3d center_of(std::size_t keypoint) const { return frame->center_of(keypoint, T_cw); }
};

}  // namespace orbslam
