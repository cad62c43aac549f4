// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <utility>
#include <vector>

#include "map/map.hpp"

namespace orbslam {

/// Features without points of two keyframes that agree with the epipolar geometry of their poses:
/// pairs (feature of a, feature of b), ascending feature of a, one to one. Compared are features
/// under the same vocabulary node; at most kDescriptorLow bits differ, and the feature of b lies on
/// the epipolar line to a chi-square limit of 3.84. Near the epipole, where depth cannot be
/// triangulated, one of the two needs a measured depth. Empty when a keyframe is dead. Takes the
/// read lock while it copies. Throws StateError when a frame has not been described.
std::vector<std::pair<std::uint32_t, std::uint32_t>> match_for_triangulation(const Map& map,
                                                                             KeyFrameId a,
                                                                             KeyFrameId b);

struct NewPointOptions {
  bool monocular = false;         ///< compare baselines with the scene's depth, not with the rig's
  std::size_t n_neighbours = 10;  ///< 20 for a single camera
};

/// Triangulates new points between `current` and its best covisible keyframes and adds them to the
/// map (Mur-Artal et al. 2015, section VI-C). A neighbour is left out when it is closer than the
/// rig's baseline, with a single camera than 1 % of the median depth of its points. A pair of
/// match_for_triangulation() becomes a point if PairTriangulation accepts it, both keyframes have
/// not moved, and both features are still without a point. Between neighbours the function reads
/// `should_stop` (a keyframe is waiting) and returns early; nullptr never stops. Takes short locks.
/// Returns the new points, none for a dead keyframe. See docs/method/mapping.md#new-points.
std::vector<MapPointId> create_new_points(Map& map, KeyFrameId current,
                                          const NewPointOptions& options,
                                          const std::atomic<bool>* should_stop);

}  // namespace orbslam
