// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "map/map.hpp"

namespace orbslam {

/// Checks, in O(map), what must hold whenever nobody holds the map's write lock:
/// - a point lists its observers once each, ascending; all live, hold it in the slot it names and
///   agree whether that keypoint has depth;
/// - its weighted count is that of its observations and at least 1; its reference keyframe sees it;
/// - the slots of a published keyframe hold only living points that are observed there;
/// - covisibility weights are positive and mutual, both ends live; KeyFrame::neighbours is their
///   sorted view;
/// - parents and children name each other and live; every published keyframe but the roots of maps
///   has a parent, and none is above itself;
/// - loop edges are mutual, both ends live;
/// - every keyframe belongs to a map whose root lives and belongs to it; observers of a point,
///   neighbours, parents and loop edges are of one map; one map is active;
/// - the map counts as many published keyframes as there are, in all and of each map;
/// - with `require_words`, every keyframe carries words.
///
/// Returns one sentence per violation (none: the map is consistent). Takes the read lock. See
/// docs/method/map.md#invariants.
std::vector<std::string> check_invariants(const Map& map, bool require_words);

}  // namespace orbslam
