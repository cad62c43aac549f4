// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <utility>
#include <vector>

#include "map/map.hpp"

namespace orbslam {

/// Features without points of two keyframes that agree with the epipolar geometry (spec 06, 2.9):
/// pairs (feature of a, feature of b), ascending feature of a, one to one.
std::vector<std::pair<std::uint32_t, std::uint32_t>> match_for_triangulation(const Map& map,
                                                                             KeyFrameId a,
                                                                             KeyFrameId b);

struct NewPointOptions {
  bool monocular = false;
  std::size_t n_neighbours = 10;  ///< 20 for a single camera
};

/// Spec 13, section 5: triangulates new points between `current` and its best neighbours and adds
/// them to the map. Between neighbours it reads `should_stop` (a keyframe is waiting) and returns
/// early; nullptr never stops. Takes short locks. Returns the new points.
std::vector<MapPointId> create_new_points(Map& map, KeyFrameId current,
                                          const NewPointOptions& options,
                                          const std::atomic<bool>* should_stop);

}  // namespace orbslam
