// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "map/map.hpp"

namespace orbslam {

/// Checks the eight invariants of spec 10, section 4, in O(map). Returns one sentence per
/// violation (none: the map is consistent). Takes the read lock.
/// `require_words`: every keyframe must carry words.
std::vector<std::string> check_invariants(const Map& map, bool require_words);

}  // namespace orbslam
