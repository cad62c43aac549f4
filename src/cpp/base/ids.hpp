// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <limits>

namespace orbslam {

/// A strong integer id. Ids count up from 0 within one map and are never reused, so that
/// "ascending id" is creation order and can serve as the tie-break everywhere.
template <class Tag>
struct Id {
  std::int64_t value = -1;

  constexpr Id() = default;
  constexpr explicit Id(std::int64_t v) : value(v) {}
  constexpr bool valid() const { return value >= 0; }

  friend constexpr bool operator==(Id a, Id b) { return a.value == b.value; }
  friend constexpr bool operator!=(Id a, Id b) { return a.value != b.value; }
  friend constexpr bool operator<(Id a, Id b) { return a.value < b.value; }
  friend constexpr bool operator>(Id a, Id b) { return a.value > b.value; }
  friend constexpr bool operator<=(Id a, Id b) { return a.value <= b.value; }
  friend constexpr bool operator>=(Id a, Id b) { return a.value >= b.value; }
};

using KeyFrameId = Id<struct KeyFrameTag>;
using MapPointId = Id<struct MapPointTag>;

/// Ids from here on belong to temporary points. Localization mode makes them of the last frame's
/// depths. They have no observations, and the map does not contain them. A keypoint with a
/// temporary point can still be matched to a point of the map.
inline constexpr MapPointId kFirstTemporaryPoint{std::int64_t{1} << 62};
constexpr bool is_temporary(MapPointId id) { return id >= kFirstTemporaryPoint; }

/// Which map a keyframe belongs to: maps are numbered in the order in which they begin, over the
/// whole life of a store, also across clear().
using MapIndex = std::int64_t;
inline constexpr MapIndex kNoMap = -1;

/// Frames are numbered by the tracker: every image consumes exactly one id, so differences of
/// frame ids serve as a clock (keyframe spacing, grace period after a relocalization).
using FrameId = std::int64_t;

// Vectors of ids cross to Python as int64 arrays without conversion.
static_assert(sizeof(MapPointId) == sizeof(std::int64_t));
static_assert(sizeof(KeyFrameId) == sizeof(std::int64_t));

}  // namespace orbslam

template <class Tag>
struct std::hash<orbslam::Id<Tag>> {
  std::size_t operator()(orbslam::Id<Tag> id) const noexcept {
    return std::hash<std::int64_t>()(id.value);
  }
};
