// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "base/similarity.hpp"
#include "map/map.hpp"

namespace orbslam {

/// Moves all keyframes and points of a map: `x' = S x`. Viewing directions and scale ranges are
/// computed again, and KeyFrame::scale is multiplied by the scale. Counts as a big change. Holds
/// the write lock throughout; no other thread may work on the map. Does nothing for a map without
/// keyframes.
void transform_map(Map& map, MapIndex which, const Similarity& S);

}  // namespace orbslam
