// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "base/similarity.hpp"
#include "map/map.hpp"

namespace orbslam {

/// Moves all keyframes and points of a map: `x' = S x`. What follows from their places (viewing
/// directions, scale ranges) is worked out anew, and lengths around the keyframes are noted as
/// multiplied by the scale. Counts as a big change. Takes the write lock for all of it; nobody may
/// work on the map meanwhile. Does nothing for a map without keyframes.
void transform_map(Map& map, MapIndex which, const Similarity& S);

}  // namespace orbslam
