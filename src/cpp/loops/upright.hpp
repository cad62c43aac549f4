// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "base/similarity.hpp"
#include "map/map.hpp"

namespace orbslam {

/// Map::is_upright() under the read lock.
bool is_upright(const Map& map, MapIndex which);

/// The world's third axis is up in the pose T_cw of a camera and in the world that a loop measured
/// S_cw in. The similarity X with which S_cw X has the camera's place by the loop, and roll and
/// pitch of T_cw; the yaw is the nearest one. None if the loop contradicts roll and pitch by more
/// than 0.05 rad, because then one of the two is wrong. See docs/method/loops.md#gravity.
std::optional<Similarity> upright_correction(const Pose& T_cw, const Similarity& S_cw);

}  // namespace orbslam
