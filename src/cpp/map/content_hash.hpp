// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "map/map.hpp"

namespace orbslam {

/// A 64-bit hash over keyframes (ids, poses, parents), points (ids, positions, descriptors) and
/// observations: equal maps, bit for bit, have equal hashes in every run. The tracker's counters
/// of a point do not enter, so localization without mapping leaves it unchanged. Takes the read
/// lock. See docs/method/threads.md#deterministic-mode.
std::uint64_t content_hash(const Map& map);

}  // namespace orbslam
