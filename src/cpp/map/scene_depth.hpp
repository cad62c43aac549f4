// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "map/map.hpp"

namespace orbslam {

/// Lower median of the depths of a keyframe's living points in its camera [world units]: element
/// (n - 1) / 2 in ascending order; nothing without points. May be negative when the points lie
/// behind. The caller holds a lock. See docs/method/mapping.md#new-points.
std::optional<double> median_scene_depth(const Map& map, const KeyFrame& keyframe);

}  // namespace orbslam
